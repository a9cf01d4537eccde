#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

// Hours of samples, interrupted after a moment.
Launch endless(const Scratch& scratch) {
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = {"render", "builtin:default", "--size",  "1024x1024", "--spp", "60000",
                      "-o",     "a.exr",           "--stats", "s.json"};
  return launch;
}

void wait_a_moment() { std::this_thread::sleep_for(std::chrono::milliseconds(1500)); }

class Interrupt : public ::testing::TestWithParam<int> {};

TEST_P(Interrupt, StopsSoonAndLeavesNothing) {
  Scratch scratch;
  Launch launch = endless(scratch);
  launch.while_running = [](int pid) {
    wait_a_moment();
    ::kill(pid, GetParam());
  };
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 128 + GetParam());
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("interrupted"));
  EXPECT_TRUE(scratch.files().empty());
}

INSTANTIATE_TEST_SUITE_P(Signals, Interrupt, ::testing::Values(SIGINT, SIGTERM, SIGHUP));

}  // namespace
}  // namespace octrace::test
