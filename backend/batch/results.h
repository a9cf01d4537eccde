// The files of a whole job, made from the journals of its output folder: cameras.json, objects.json
// and annotations.json as the job asks for them (docs/batch.md, "What is written at the end").
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "backend/batch/plan.h"
#include "backend/util/result.h"

namespace octrace::batch {

struct JobFailure {
  std::int64_t view = -1;  // -1: a scene, whose missing views failed with it
  std::uint64_t scene = 0;
  nlohmann::ordered_json error;  // as in the journal
};

// What the journals tell of a job as a whole.
struct JobResults {
  static constexpr std::size_t kMostListed = 1000;  // of failures and of missing ranges

  std::uint64_t views = 0, done = 0, journals = 0, broken_lines = 0;
  std::vector<JobFailure> failures;  // of views that are not done
  // First and last of each run of views that are not done.
  std::vector<std::pair<std::uint64_t, std::uint64_t>> missing;
  double seconds = 0.0, longest_run_s = 0.0;  // of all runs together; of the longest
};

// Reads the journals once, then each view's line again in the order of views: memory is 16 bytes a
// view and the scenes' objects. A view is done when its line is there and its files have the sizes
// that the line says. Exit 5 where a file cannot be written; a usage error where a journal belongs
// to another job. The caller flushes the folder, or writes another file there, which does so.
util::Result<JobResults> write_job_results(const Plan& plan);

// `octrace batch JOB.json --merge`: the same for the journals of all shards, and summary.json. Exit
// 5 where a run holds a lock of the folder for longer than `wait_lock` seconds.
util::Result<JobResults> merge_job(const Plan& plan, const util::Limits& limits, double wait_lock);

}  // namespace octrace::batch
