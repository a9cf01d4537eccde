#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>

#include "backend/util/atomic_file.h"
#include "backend/util/interrupt.h"

namespace octrace::test {
namespace {

// In a process of its own: the flag stays set for good, as it should.
TEST(InterruptDeathTest, FlagIsSetAndNothingIsCommitted) {
  const std::string path =
      (std::filesystem::temp_directory_path() / "octrace_interrupt.txt").string();
  EXPECT_EXIT(
      {
        const util::InterruptGuard guard;
        if (util::interrupt_flag() || util::interrupt_signal() != 0) std::exit(1);
        std::raise(SIGTERM);
        if (!util::interrupt_flag() || util::interrupt_signal() != SIGTERM) std::exit(2);
        if (util::write_file(path, "content")) std::exit(3);
        std::exit(std::filesystem::exists(path) ? 4 : 0);
      },
      ::testing::ExitedWithCode(0), "");
}

TEST(InterruptDeathTest, ASecondSignalEndsTheProcess) {
  EXPECT_EXIT(
      {
        const util::InterruptGuard guard;
        std::raise(SIGINT);
        std::raise(SIGINT);
        std::exit(0);
      },
      ::testing::KilledBySignal(SIGINT), "");
}

TEST(InterruptDeathTest, OutsideOfAGuardSignalsEndTheProcess) {
  EXPECT_EXIT(
      {
        { const util::InterruptGuard guard; }
        std::raise(SIGTERM);
        std::exit(0);
      },
      ::testing::KilledBySignal(SIGTERM), "");
}

}  // namespace
}  // namespace octrace::test
