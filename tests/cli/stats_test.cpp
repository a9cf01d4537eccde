#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using nlohmann::json;

json stats(const std::vector<std::string>& more) {
  Scratch scratch;
  std::vector<std::string> arguments = {
      "render", "builtin:paper",       "--size",  "64x48",
      "-o",     scratch.path("a.exr"), "--stats", scratch.path("s.json")};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return json::parse(read_text(scratch.path("s.json")));
}

TEST(Stats, SayWhatWasDone) {
  const json found = stats({"--aov", "Z,beauty", "--spp", "3", "--threads", "2"});
  EXPECT_THAT(found["octrace"].get<std::string>(),
              ::testing::MatchesRegex("[0-9]+\\.[0-9]+\\.[0-9]+"));
  EXPECT_THAT(found["device"].get<std::string>(), ::testing::HasSubstr("2 threads"));
  EXPECT_EQ(found["scene"]["source"], "builtin:paper");
  EXPECT_EQ(found["scene"]["triangles"], 1692);
  EXPECT_EQ(found["scene"]["vertices"], 855);
  EXPECT_EQ(found["image"]["width"], 64);
  EXPECT_EQ(found["image"]["height"], 48);
  EXPECT_EQ(found["image"]["spp"], 3);
  EXPECT_EQ(found["rays"]["camera"], 64 * 48);
  EXPECT_GE(found["rays"]["beauty"], 3 * 64 * 48);
  EXPECT_EQ(found["rays"]["total"].get<int>(), found["rays"]["camera"].get<int>() +
                                                   found["rays"]["beauty"].get<int>() +
                                                   found["rays"]["shadow"].get<int>());
  EXPECT_GT(found["mrays_per_s"], 0.0);
  double sum = 0.0;
  for (const char* stage : {"load", "build", "trace", "write"}) {
    EXPECT_GT(found["ms"][stage], 0.0) << stage;
    sum += found["ms"][stage].get<double>();
  }
  EXPECT_GE(found["ms"]["total"].get<double>(), sum);
  EXPECT_EQ(found["ms"]["verify"], 0.0);
  EXPECT_EQ(found["octree"]["builder"], "sah");
  EXPECT_EQ(found["octree"]["triangles"], 1692);
  EXPECT_GT(found["octree"]["nodes"], 10);
  EXPECT_GT(found["octree"]["depth"], 1);
  EXPECT_GT(found["octree"]["bytes"], 1692 * 48);
  EXPECT_GT(found["octree"]["walk_bytes"], 0);
  EXPECT_GT(found["peak_rss_bytes"], 1 << 20);
}

TEST(Stats, GoToStandardOutputAndLeaveNoFile) {
  Scratch scratch;
  const Outcome outcome = run({"render", "builtin:paper", "--size", "8x6", "--aov", "Z", "-o",
                               scratch.path("a.npz"), "--stats", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["image"]["width"], 8);
  EXPECT_FALSE(std::filesystem::exists("-"));
}

// TBB warned of them.
TEST(Stats, MoreThreadsThanCoresAreTakenWithoutAWord) {
  Scratch scratch;
  const Outcome outcome = run({"render", "builtin:paper", "--size", "8x6", "--aov", "Z", "-o",
                               scratch.path("a.npz"), "--threads", "600", "--quiet"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err, "");
}

TEST(Stats, DepthAloneTracesOneRayAPixel) {
  const json found = stats({"--aov", "Z", "--spp", "16", "--builder", "median", "--verify"});
  EXPECT_EQ(found["rays"]["total"], 64 * 48);
  EXPECT_EQ(found["octree"]["builder"], "median");
  EXPECT_GT(found["ms"]["verify"], 0.0);
}

}  // namespace
}  // namespace octrace::test
