// The scripts that hand a job to Slurm: an array of which each task is a shard, and a task after it
// that merges (docs/batch.md, "Slurm").
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::batch {

struct SlurmJob {
  std::string program, job;  // absolute paths of octrace and of the job's file
  std::string out;           // --out, absolute; empty: none
  std::uint64_t tasks = 1;
  std::vector<std::string> options;  // more of octrace batch, for the array: --device cuda
  std::vector<std::string> limits;   // --max-views N and the like, for all tasks
};

// As one word of a POSIX shell, whatever it holds.
std::string shell_word(std::string_view text);
// The words of a line as a shell divides it by blanks, quotes and backslashes, expanding nothing. A
// usage error where a quote does not end.
util::Result<std::vector<std::string>> split_words(std::string_view line);

std::string slurm_array_script(const SlurmJob& job);
std::string slurm_merge_script(const SlurmJob& job);

}  // namespace octrace::batch
