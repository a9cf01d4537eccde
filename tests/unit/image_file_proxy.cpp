// The file that images are written through: whatever the order of writes, the bytes are those that
// a plain file would hold, and what the system refuses is said.
#include "backend/image/file_proxy.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

namespace octrace::test {
namespace {

using image::FileProxy;

class FileProxyTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() /
             ("octrace_proxy_" + std::to_string(::getpid()) + "_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name()))
                .string();
    std::ofstream(path_) << "old";
  }
  void TearDown() override { std::filesystem::remove(path_); }

  std::string content() const {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  std::string path_;
};

TEST_F(FileProxyTest, RandomWritesSeeksAndReadsAreThoseOfAPlainFile) {
  std::mt19937 random(7);
  std::string expected;
  {
    FileProxy file(path_);
    ASSERT_EQ(file.error_number(), 0);
    std::size_t place = 0;
    for (int i = 0; i < 3000; ++i) {
      // Mostly a few bytes, sometimes more than is kept waiting.
      const std::size_t size = random() % 100 == 0 ? random() % 600'000 : random() % 40;
      const std::string bytes(size, static_cast<char>('a' + random() % 26));
      if (random() % 8 == 0 && !expected.empty()) {
        place = random() % expected.size();
        ASSERT_TRUE(file.seek(static_cast<std::int64_t>(place)));
      }
      if (random() % 16 == 0) {
        ASSERT_EQ(file.pwrite(bytes.data(), size, static_cast<std::int64_t>(place)), size);
      } else {
        ASSERT_EQ(file.write(bytes.data(), size), size);
      }
      expected.resize(std::max(expected.size(), place + size));
      expected.replace(place, size, bytes);
      place = static_cast<std::size_t>(file.tell());
      ASSERT_EQ(file.size(), expected.size());
      if (random() % 32 == 0) {
        std::string back(50, '\0');
        const std::size_t from = random() % (expected.size() + 1);
        const std::size_t got =
            file.pread(back.data(), back.size(), static_cast<std::int64_t>(from));
        ASSERT_EQ(back.substr(0, got), expected.substr(from, 50));
      }
    }
    file.close();
    EXPECT_EQ(file.error_number(), 0);
  }
  EXPECT_TRUE(content() == expected);
}

TEST_F(FileProxyTest, WhatWaitsIsWrittenWhenItIsDestroyed) {
  { FileProxy(path_).write("new", 3); }
  EXPECT_EQ(content(), "new");
}

TEST_F(FileProxyTest, AFullDiskIsKnownAfterClose) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  FileProxy file("/dev/full");
  EXPECT_EQ(file.write("few", 3), 3u);
  EXPECT_EQ(file.error_number(), 0);
  file.close();
  EXPECT_EQ(file.error_number(), ENOSPC);
  EXPECT_EQ(file.write("more", 4), 0u);
}

}  // namespace
}  // namespace octrace::test
