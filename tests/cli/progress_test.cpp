#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using ::testing::HasSubstr;

Outcome render(const std::vector<std::string>& more, bool terminal = false) {
  Scratch scratch;
  Launch launch;
  launch.folder = scratch.folder();
  launch.terminal = terminal;
  launch.arguments = {"render", "builtin:paper", "--size", "64x48", "--spp", "1", "-o", "a.exr"};
  launch.arguments.insert(launch.arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  return outcome;
}

TEST(Progress, PipedSaysOneLineAtTheEnd) {
  const Outcome outcome = render({});
  EXPECT_THAT(outcome.err, ::testing::MatchesRegex("octrace: a.exr: 1692 triangles, [^\n\r]*\n"));
}

TEST(Progress, BarOnATerminal) {
  const Outcome outcome = render({}, true);
  EXPECT_THAT(outcome.err, HasSubstr("\r\033[Ktrace ["));
  EXPECT_THAT(render({"--progress", "bar"}).err, HasSubstr("trace ["));
}

TEST(Progress, NothingWhenToldSo) {
  EXPECT_EQ(render({"--quiet"}, true).err, "");
  EXPECT_EQ(render({"--quiet", "--progress", "none"}).err, "");
  EXPECT_EQ(render({"--progress", "none"}, true).err.find("trace ["), std::string::npos);
}

TEST(Progress, JsonLines) {
  const Outcome outcome = render({"--progress", "json", "--quiet"});
  std::istringstream lines(outcome.err);
  std::vector<std::string> stages;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json entry = nlohmann::json::parse(line);
    const std::string stage = entry["stage"];
    if (stages.empty() || stages.back() != stage) stages.push_back(stage);
    EXPECT_GE(entry["done"], 0.0);
    EXPECT_LE(entry["done"], 1.0);
    EXPECT_GE(entry["elapsed_s"], 0.0);
  }
  EXPECT_THAT(stages, ::testing::ElementsAre("load", "trace", "write"));
}

TEST(Verbosity, VerboseSaysWhatIsDone) {
  const Outcome outcome = render({"--verbose", "--verify"});
  EXPECT_THAT(outcome.err, HasSubstr("loaded in"));
  EXPECT_THAT(outcome.err, HasSubstr("built in"));
  EXPECT_THAT(outcome.err, HasSubstr("verified in"));
  EXPECT_THAT(outcome.err, HasSubstr("wrote a.exr"));
}

}  // namespace
}  // namespace octrace::test
