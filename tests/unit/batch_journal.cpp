#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "backend/batch/journal.h"

namespace octrace::test {
namespace {

using batch::Journal;
using nlohmann::ordered_json;

class JournalTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "octrace_journal_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    path_ = name + "/journal-1-of-1.ndjson";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::vector<int> views() {
    std::vector<int> found;
    const auto text = batch::read_journal(path_, [&](const ordered_json& line) {
      found.push_back(line.at("view").get<int>());
      return util::Result<void>();
    });
    EXPECT_TRUE(text) << text.error().to_string();
    return found;
  }
  void add(const std::string& bytes) {
    std::ofstream(path_, std::ios::binary | std::ios::app) << bytes;
  }

  std::filesystem::path folder_;
  std::string path_;
};

void append(Journal& journal, int view) {
  const auto done = journal.append(fmt::format(R"({{"kind":"view","view":{}}})", view));
  EXPECT_TRUE(done) << done.error().to_string();
}

TEST_F(JournalTest, KeepsLinesInOrderOverRuns) {
  for (int run = 0; run < 3; ++run) {
    auto journal = Journal::open(path_);
    ASSERT_TRUE(journal);
    append(*journal, 2 * run);
    append(*journal, 2 * run + 1);
    EXPECT_TRUE(journal->flush());
  }
  EXPECT_THAT(views(), ::testing::ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(JournalTest, ATornLastLineIsLeftOutAndCutOff) {
  const std::string whole = R"({"kind":"view","view":7})";
  for (std::size_t length = 1; length <= whole.size(); ++length) {
    std::filesystem::remove(path_);
    add(R"({"kind":"view","view":1})"
        "\n");
    add(whole.substr(0, length));  // even the whole text without its line break is torn
    EXPECT_THAT(views(), ::testing::ElementsAre(1)) << length;
    auto journal = Journal::open(path_);
    ASSERT_TRUE(journal);
    append(*journal, 2);
    EXPECT_THAT(views(), ::testing::ElementsAre(1, 2)) << length;
  }
}

TEST_F(JournalTest, BrokenLinesAreCountedAndPassed) {
  add("{\"view\":1}\n");
  add(std::string("\0\0\0\0\n", 5));
  add("[1,2]\n{\"view\":\n{\"view\":2}\n");
  std::vector<int> found;
  const auto text = batch::read_journal(path_, [&](const ordered_json& line) {
    found.push_back(line.at("view").get<int>());
    return util::Result<void>();
  });
  ASSERT_TRUE(text);
  EXPECT_EQ(text->lines, 2u);
  EXPECT_EQ(text->broken_lines, 3u);
  EXPECT_THAT(found, ::testing::ElementsAre(1, 2));
}

TEST_F(JournalTest, AFullDiskLeavesWholeLinesOnly) {
  auto journal = Journal::open(path_);
  ASSERT_TRUE(journal);
  append(*journal, 1);
  const auto before = std::filesystem::file_size(path_);
  struct rlimit old {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const struct rlimit full { before + 5, old.rlim_max };
  const auto action = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &full), 0);
  const auto failed = journal->append(R"({"kind":"view","view":2})");
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, action);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().exit, util::Exit::io);
  EXPECT_EQ(std::filesystem::file_size(path_), before);
  append(*journal, 3);
  EXPECT_THAT(views(), ::testing::ElementsAre(1, 3));
}

TEST_F(JournalTest, ALineOfAnotherKindIsAnErrorWithItsNumber) {
  add("{\"view\":1}\n{\"view\":\"x\"}\n");
  const auto text = batch::read_journal(path_, [&](const ordered_json& line) {
    static_cast<void>(line.at("view").get<int>());
    return util::Result<void>();
  });
  ASSERT_FALSE(text);
  EXPECT_EQ(text.error().exit, util::Exit::io);
  EXPECT_THAT(text.error().message, ::testing::HasSubstr("line 2"));
}

}  // namespace
}  // namespace octrace::test
