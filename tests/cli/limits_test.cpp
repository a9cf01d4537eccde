#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

struct Limit {
  const char* option;
  const char* value;
  std::vector<std::string> arguments;
};

class Limits : public ::testing::TestWithParam<Limit> {};

TEST_P(Limits, ExceedingOneNamesIt) {
  Scratch scratch;
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = GetParam().arguments;
  launch.arguments.insert(launch.arguments.end(), {GetParam().option, GetParam().value});
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 6) << outcome.err;
  EXPECT_THAT(outcome.err, ::testing::HasSubstr(GetParam().option));
  EXPECT_TRUE(scratch.files().empty());
}

const std::vector<std::string> kRender = {"render", "builtin:paper", "-o", "a.exr"};

INSTANTIATE_TEST_SUITE_P(
    Options, Limits,
    ::testing::Values(Limit{"--max-image-pixels", "100", kRender}, Limit{"--max-spp", "8", kRender},
                      Limit{"--max-triangles", "1000", {"info", "builtin:terrain:64"}},
                      Limit{"--max-triangles", "1000", {"info", "builtin:soup:5000"}},
                      Limit{"--max-scene-bytes", "1k", {"info", "builtin:paper"}}));

TEST(Limits, DefaultSizesOfImagesAreBounded) {
  const Outcome outcome =
      run({"render", "builtin:paper", "-o", "/tmp/a.exr", "--size", "99999x99999"});
  EXPECT_EQ(outcome.exit_code, 6);
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("--max-image-pixels"));
}

}  // namespace
}  // namespace octrace::test
