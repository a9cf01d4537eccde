#include <gtest/gtest.h>

#include <algorithm>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

// EXR files hold no date and no machine, so equal pixels are equal files.
TEST(Identity, ThreadsTilesAndBuildersChangeNoBit) {
  Scratch scratch;
  const auto render = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {
        "render", "builtin:default",     "--size", "48x32", "--aov", "all",
        "-o",     scratch.path("a.exr"), "--quiet"};
    if (std::find(more.begin(), more.end(), "--spp") == more.end()) {
      arguments.insert(arguments.end(), {"--spp", "2"});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_text(scratch.path("a.exr"));
  };
  const std::string reference = render({"--threads", "1"});
  ASSERT_GT(reference.size(), 10000u);
  EXPECT_TRUE(reference == render({"--threads", "2"}));
  EXPECT_TRUE(reference == render({"--threads", "5"}));
  EXPECT_TRUE(reference == render({"--tile", "8"}));
  EXPECT_TRUE(reference == render({"--tile", "64"}));
  EXPECT_TRUE(reference == render({"--tile", "1000", "--threads", "2"}));
  EXPECT_TRUE(reference == render({"--builder", "median"}));
  EXPECT_TRUE(reference == render({"--builder", "sah"}));
  EXPECT_TRUE(reference == render({"--builder", "quality", "--verify"}));
  EXPECT_TRUE(reference == render({"--builder", "median", "--leaf", "32"}));
  EXPECT_TRUE(reference == render({"--builder", "sah", "--leaf", "1"}));
  EXPECT_TRUE(reference == render({"--verify"}));
  // The comparison can fail:
  EXPECT_FALSE(reference == render({"--seed", "1"}));
  EXPECT_FALSE(reference == render({"--spp", "5"}));
  EXPECT_FALSE(reference == render({"--alpha", "ignore"}));
}

TEST(Identity, IntegerFormatsToo) {
  Scratch scratch;
  const auto render = [&](const std::string& file, const std::string& threads) {
    const Outcome outcome = run({"render", "builtin:default", "--size", "40x30", "--spp", "2",
                                 "--quiet", "--threads", threads, "-o", scratch.path(file)});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_text(scratch.path(file));
  };
  for (const char* file : {"a.png", "a.tif", "a.jpg"}) {
    EXPECT_TRUE(render(file, "1") == render(file, "2")) << file;
  }
}

}  // namespace
}  // namespace octrace::test
