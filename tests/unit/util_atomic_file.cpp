#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "backend/util/atomic_file.h"
#include "backend/util/grouped_commit.h"

namespace octrace::test {
namespace {

namespace fs = std::filesystem;

class AtomicFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("octrace_atomic_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  std::size_t count() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), {}));
  }
  static std::string text(const std::string& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  fs::path folder_;
};

TEST_F(AtomicFileTest, AppearsWhenCommitted) {
  util::Result<util::AtomicFile> file = util::AtomicFile::create(path("a.exr"));
  ASSERT_TRUE(file);
  EXPECT_EQ(fs::path(file->temporary()).extension(), ".exr");
  EXPECT_EQ(fs::path(file->temporary()).filename().string()[0], '.');
  std::ofstream(file->temporary()) << "content";
  EXPECT_FALSE(fs::exists(path("a.exr")));
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(text(path("a.exr")), "content");
  EXPECT_EQ(count(), 1u);
}

TEST_F(AtomicFileTest, InAGroupToo) {
  {
    util::GroupedCommit group;
    EXPECT_EQ(util::GroupedCommit::of_this_thread(), &group);
    std::thread([] { EXPECT_EQ(util::GroupedCommit::of_this_thread(), nullptr); }).join();
    ASSERT_TRUE(util::write_file(path("a.json"), "content"));
    EXPECT_EQ(text(path("a.json")), "content");
    EXPECT_GT(group.milliseconds(), 0.0);
    util::flush_folder(path(""));
    util::flush_folder(path("none"));  // no error
  }
  EXPECT_EQ(util::GroupedCommit::of_this_thread(), nullptr);
  EXPECT_EQ(count(), 1u);
}

TEST_F(AtomicFileTest, InAGroupThatWaitsTheyAppearWhenItIsFinished) {
  {
    util::GroupedCommit group(util::GroupedCommit::When::by_finish);
    ASSERT_TRUE(util::write_file(path("a.json"), "a"));
    ASSERT_TRUE(util::write_file(path("b.json"), "b"));
    EXPECT_FALSE(fs::exists(path("a.json")));
    ASSERT_TRUE(group.finish());
    EXPECT_EQ(text(path("a.json")) + text(path("b.json")), "ab");
    ASSERT_TRUE(util::write_file(path("c.json"), "c"));  // and is not finished
  }
  EXPECT_EQ(count(), 2u);
}

TEST_F(AtomicFileTest, AGroupSaysWhichFileFailedAndDropsTheRest) {
  util::GroupedCommit group(util::GroupedCommit::When::by_finish);
  ASSERT_TRUE(util::write_file(path("a.json"), "a"));
  fs::create_directories(path("a.json") + "/in the way");
  ASSERT_TRUE(util::write_file(path("b.json"), "b"));
  const util::Result<void> finished = group.finish();
  ASSERT_FALSE(finished);
  EXPECT_EQ(finished.error().file, path("a.json"));
  EXPECT_EQ(count(), 1u);
}

TEST_F(AtomicFileTest, CommittedTogetherTheFirstErrorOfTheListCounts) {
  const auto fails = [&](const std::string& file) {
    return [file] { return util::write_file(file, "x"); };
  };
  const util::Result<void> result =
      util::commit_together({[&] { return util::write_file(path("a.json"), "a"); },
                             fails(path("no/b.json")), fails(path("no/c.json"))});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().file, path("no/b.json"));
  EXPECT_EQ(text(path("a.json")), "a");
  EXPECT_TRUE(util::commit_together({}));
}

TEST_F(AtomicFileTest, VanishesOtherwise) {
  {
    util::Result<util::AtomicFile> file = util::AtomicFile::create(path("a.exr"));
    ASSERT_TRUE(file);
    EXPECT_EQ(count(), 1u);
  }
  EXPECT_EQ(count(), 0u);
}

TEST_F(AtomicFileTest, ReplacesAndRespectsTheUmask) {
  ASSERT_TRUE(util::write_file(path("a.json"), "old"));
  const mode_t mask = ::umask(022);
  ASSERT_TRUE(util::write_file(path("a.json"), "new"));
  ::umask(mask);
  EXPECT_EQ(text(path("a.json")), "new");
  struct stat status {};
  ASSERT_EQ(::stat(path("a.json").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0644u);
  EXPECT_EQ(count(), 1u);
}

TEST_F(AtomicFileTest, FollowsLinks) {
  fs::create_directories(folder_ / "elsewhere");
  ASSERT_TRUE(util::write_file(path("elsewhere/real.json"), "old"));
  fs::create_symlink("elsewhere/real.json", path("link.json"));
  ASSERT_TRUE(util::write_file(path("link.json"), "new"));
  EXPECT_TRUE(fs::is_symlink(path("link.json")));
  EXPECT_EQ(text(path("elsewhere/real.json")), "new");
}

TEST_F(AtomicFileTest, LeavesWhatIsNoFileAlone) {
  ASSERT_EQ(::mkfifo(path("pipe.json").c_str(), 0600), 0);
  const util::Result<void> written = util::write_file(path("pipe.json"), "content");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().exit, util::Exit::io);
  EXPECT_TRUE(fs::is_fifo(path("pipe.json")));
}

TEST_F(AtomicFileTest, FoldersAndMissingFoldersAreErrors) {
  for (const std::string& target :
       {folder_.string(), folder_.string() + "/", path("missing/a.exr"), std::string()}) {
    const util::Result<util::AtomicFile> file = util::AtomicFile::create(target);
    ASSERT_FALSE(file) << target;
    EXPECT_EQ(file.error().exit, util::Exit::io);
  }
  EXPECT_EQ(count(), 0u);
}

}  // namespace
}  // namespace octrace::test
