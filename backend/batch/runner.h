// Renders what of a plan is not done: scenes are loaded once, views traced one after the other, and
// encoded and written by other threads meanwhile (view_writer.h).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "backend/batch/plan.h"
#include "backend/octree/octree.h"
#include "backend/render/device.h"
#include "backend/util/result.h"

namespace octrace::batch {

// How far a run has come; views of its shard.
struct Standing {
  std::uint64_t views = 0;   // of the shard
  std::uint64_t before = 0;  // done when the run started
  std::uint64_t done = 0;    // by this run
  std::uint64_t failed = 0;
  double seconds = 0.0;  // of this run
  std::string scene;     // the one being traced

  std::uint64_t left() const { return views - before - done - failed; }
  double views_per_s() const { return seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0; }
};

struct RunOptions {
  Shard shard;
  bool force = false;
  double wait_lock = 0.0;  // seconds (LockWait)
  unsigned threads = 0;    // that trace; two more encode and write; 0: all cores
  std::uint32_t tile = 0;
  bool verify = false;
  octree::BuildOptions build;
  render::DeviceChoice device;
  util::Limits limits;
  std::function<void(const Standing&)> progress;  // after every view; from one thread at a time
};

struct Failure {
  std::optional<std::uint64_t> view;  // none: the scene
  std::size_t scene = 0;
  std::uint64_t views = 1;  // that failed by it
  util::Error error;
};

struct RunSummary {
  static constexpr std::size_t kMostFailures = 1000;  // kept; the journal has all

  Standing standing;
  std::uint64_t scenes_loaded = 0, broken_lines = 0;
  std::vector<Failure> failures;
  // What ended the run early (a full disk, a folder that became read-only), or kept its results
  // from being written.
  std::optional<util::Error> fatal;
  bool interrupted = false;
  std::string device;
  // Milliseconds: of the tracing thread (load: what it waited for), and of all writers together.
  double load_ms = 0.0, trace_ms = 0.0, wait_ms = 0.0, encode_ms = 0.0, flush_ms = 0.0;
};

// An error: nothing was rendered. Else what came of it, also where it ended early; the summary and
// the files made from the journals are written (finish.h).
util::Result<RunSummary> run_plan(const Plan& plan, const RunOptions& options);

}  // namespace octrace::batch
