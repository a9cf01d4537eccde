#include "validation/reference/process.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "backend/util/atomic_file.h"
#include "validation/reference/output.h"
#include "validation/reference/scratch.h"

namespace octrace::validation::test {
namespace {

using std::chrono::milliseconds;

class Process : public testing::Test {
 protected:
  void SetUp() override {
    auto scratch = Scratch::create("octrace-test");
    ASSERT_TRUE(scratch);
    scratch_.emplace(std::move(*scratch));
  }
  Command shell(const std::string& script) {
    return {.arguments = {"sh", "-c", script},
            .folder = scratch_->path(),
            .log = scratch_->file("log"),
            .timeout = milliseconds(30000)};
  }
  std::string log() {
    std::ifstream stream(scratch_->file("log"));
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::optional<Scratch> scratch_;
};

TEST_F(Process, CapturesBothStreamsAndTheExitCode) {
  const Command command = shell("pwd; echo problem >&2; exit 42");
  const auto result = run_process(command);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 42);
  EXPECT_FALSE(result->timed_out);
  EXPECT_NE(log().find(std::filesystem::path(scratch_->path()).filename()), std::string::npos);
  const util::Error error = process_error("The shell", command, *result);
  EXPECT_EQ(error.exit, util::Exit::io);
  EXPECT_NE(error.message.find("The shell (sh) failed with exit code 42"), std::string::npos);
  EXPECT_NE(error.message.find("problem"), std::string::npos);
}

TEST_F(Process, ArgumentsAreNotExpanded) {
  const auto result = run_process({.arguments = {"printf", "%s|", "$HOME", "a b", "*", "; exit 3"},
                                   .folder = scratch_->path(),
                                   .log = scratch_->file("log")});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 0);
  EXPECT_EQ(log(), "$HOME|a b|*|; exit 3|");
}

TEST_F(Process, InputIsEmpty) {
  ASSERT_TRUE(run_process(shell("cat; echo done")));
  EXPECT_EQ(log(), "done\n");
}

TEST_F(Process, SignalsReadAsShellsReport) {
  const auto result = run_process(shell("kill -SEGV $$"));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 128 + SIGSEGV);
}

bool exists(pid_t pid) { return ::kill(pid, 0) == 0; }

pid_t pid_in(const std::string& path) {
  std::ifstream stream(path);
  pid_t pid = 0;
  stream >> pid;
  return pid;
}

bool is_zombie(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(status, text);
  return text.find(") Z") != std::string::npos;
}

// A killed process that nobody has reaped still has its entry: give it some time to change.
bool disappears(pid_t pid) {
  for (int i = 0; i < 500; ++i) {
    if (!exists(pid) || is_zombie(pid)) return true;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return false;
}

TEST_F(Process, TimeLimitKillsTheWholeGroup) {
  Command command = shell("trap '' TERM; sleep 600 & echo $! > child; wait; sleep 600");
  command.timeout = milliseconds(400);
  const auto result = run_process(command);
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->timed_out);
  EXPECT_NE(process_error("It", command, *result).message.find("time limit of 0.4 s"),
            std::string::npos);
  const pid_t child = pid_in(scratch_->file("child"));
  ASSERT_GT(child, 0);
  EXPECT_TRUE(disappears(child));
}

TEST_F(Process, WhatItLeavesRunningIsKilled) {
  const auto result = run_process(shell("sleep 600 & echo $! > child"));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->exit_code, 0);
  const pid_t child = pid_in(scratch_->file("child"));
  ASSERT_GT(child, 0);
  EXPECT_TRUE(disappears(child));
}

TEST_F(Process, CanBeCancelled) {
  std::atomic<bool> cancel{false};
  Command command = shell("sleep 600");
  command.cancel = &cancel;
  std::thread later([&] {
    std::this_thread::sleep_for(milliseconds(100));
    cancel = true;
  });
  const auto result = run_process(command);
  later.join();
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->cancelled);
  EXPECT_FALSE(result->timed_out);
}

TEST_F(Process, AMissingProgramIsUnsupported) {
  for (const char* name : {"octrace-no-such-program", "/nonexistent/povray", "/etc"}) {
    const auto result =
        run_process({.arguments = {name}, .folder = "", .log = scratch_->file("log")});
    ASSERT_FALSE(result) << name;
    EXPECT_EQ(result.error().exit, util::Exit::unsupported);
    EXPECT_NE(result.error().to_string().find(name), std::string::npos);
  }
}

TEST_F(Process, AProgramThatCannotStartIsAnError) {
  const std::string path = scratch_->file("broken");
  ASSERT_TRUE(util::write_file(path,
                               "\x7f"
                               "ELF but no more"));
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  const auto result =
      run_process({.arguments = {path}, .folder = "", .log = scratch_->file("log")});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().exit, util::Exit::io);
}

TEST_F(Process, TailIsTheLastLines) {
  std::string text;
  for (int i = 0; i < 5000; ++i) text += "line " + std::to_string(i) + "\n";
  ASSERT_TRUE(util::write_file(scratch_->file("log"), text + "bell\a\rlast\n\n"));
  EXPECT_EQ(log_tail(scratch_->file("log"), 3), "line 4999\nbell?\nlast");
  EXPECT_EQ(log_tail(scratch_->file("missing")), "");
  ASSERT_TRUE(util::write_file(scratch_->file("log"), "only"));
  EXPECT_EQ(log_tail(scratch_->file("log")), "only");
}

TEST_F(Process, ScratchFoldersDisappearWithTheirContents) {
  const std::string path = scratch_->path();
  ASSERT_TRUE(util::write_file(scratch_->file("file"), "text"));
  EXPECT_TRUE(std::filesystem::exists(path));
  EXPECT_EQ(std::filesystem::status(path).permissions(), std::filesystem::perms::owner_all);
  scratch_.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(Process, OldAndEmptyOutputsDoNotCount) {
  const std::string path = scratch_->file("image.png");
  ASSERT_TRUE(util::write_file(path, "left by an earlier run"));
  ASSERT_TRUE(remove_output(path));
  auto image = read_output(path, 1, 1, {});
  ASSERT_FALSE(image);
  EXPECT_NE(image.error().message.find("wrote no image"), std::string::npos);
  ASSERT_TRUE(util::write_file(path, ""));
  image = read_output(path, 1, 1, {});
  ASSERT_FALSE(image);
  EXPECT_NE(image.error().message.find("empty"), std::string::npos);
  ASSERT_TRUE(util::write_file(path, "not an image"));
  image = read_output(path, 1, 1, {});
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().exit, util::Exit::io);
}

}  // namespace
}  // namespace octrace::validation::test
