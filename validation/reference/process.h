// Runs another program without a shell, under a time limit, with its output in a file.
#pragma once

#include <atomic>
#include <chrono>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::validation {

struct Command {
  std::vector<std::string> arguments;  // [0] is the program: a path, or a name searched on PATH
  std::string folder;                  // working directory; empty: the caller's
  std::string log;                     // file that receives standard output and standard error
  std::chrono::milliseconds timeout{120000};
  const std::atomic<bool>* cancel = nullptr;  // kills the program when it becomes true
};

struct ProcessResult {
  int exit_code = 0;  // 128 + N: killed by signal N, as shells say it
  bool timed_out = false;
  bool cancelled = false;
  double seconds = 0.0;
};

// Errors: exit 4 where the program is not found or may not be run, exit 5 where it cannot be
// started. A program that ran has a result, whatever its exit code. On a timeout the whole process
// group is killed. Standard input is empty.
util::Result<ProcessResult> run_process(const Command& command);

// The program's full path, or an error (exit 4) that says where it was looked for.
util::Result<std::string> find_program(const std::string& name);

// The last lines of a log, at most `lines` of them and 4 KiB, unprintable bytes replaced.
std::string log_tail(const std::string& path, int lines = 12);

// "POV-Ray (/usr/bin/povray) failed with exit code 1; last lines of its log: ..." as exit 5.
util::Error process_error(const std::string& title, const Command& command,
                          const ProcessResult& result);

}  // namespace octrace::validation
