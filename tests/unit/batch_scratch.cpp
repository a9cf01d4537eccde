// Folders for members of packs: killed runs' are removed, running ones' are not.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>

#include "backend/batch/scratch_folder.h"

namespace octrace::test {
namespace {

namespace fs = std::filesystem;

TEST(ScratchFolder, RemovesWhatKilledRunsLeft) {
  const char* before = ::getenv("TMPDIR");
  const std::string kept = before != nullptr ? before : "";
  std::string place = fs::temp_directory_path() / "octrace_scratch_XXXXXX";
  ASSERT_NE(nullptr, ::mkdtemp(place.data()));
  ::setenv("TMPDIR", place.c_str(), 1);

  const fs::path left = fs::path(place) / "octrace-batch-killed",
                 other = fs::path(place) / "others";
  for (const fs::path& folder : {left, other}) {
    fs::create_directory(folder);
    std::ofstream(folder / "lock") << "";
    std::ofstream(folder / "a.exr") << "half";
  }
  fs::create_directory_symlink(other, fs::path(place) / "octrace-batch-link");
  {
    auto running = batch::ScratchFolder::create();
    ASSERT_TRUE(running);
    EXPECT_FALSE(fs::exists(left));
    std::ofstream(running->path() + "b.exr") << "whole";
    auto next = batch::ScratchFolder::create();
    ASSERT_TRUE(next);
    EXPECT_NE(running->path(), next->path());
    EXPECT_TRUE(fs::exists(running->path() + "b.exr"));
    EXPECT_EQ("whole", *batch::take_file(running->path() + "b.exr"));
    EXPECT_FALSE(fs::exists(running->path() + "b.exr"));
  }
  EXPECT_TRUE(fs::exists(other / "a.exr"));
  EXPECT_EQ(2, std::distance(fs::directory_iterator(place), {}));  // others and the link

  fs::remove_all(place);
  if (before != nullptr) {
    ::setenv("TMPDIR", kept.c_str(), 1);
  } else {
    ::unsetenv("TMPDIR");
  }
}

}  // namespace
}  // namespace octrace::test
