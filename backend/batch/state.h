// The folder .octrace beside a batch's outputs: who runs, what is done (docs/batch.md, "State").
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/batch/plan.h"
#include "backend/util/result.h"

namespace octrace::batch {

std::string state_folder(const std::string& output_folder);  // ends in '/'
std::string journal_path(const std::string& output_folder, const Shard& shard);
std::string shard_summary_path(const std::string& output_folder, const Shard& shard);
std::vector<std::string> journals_in(const std::string& output_folder);  // paths, sorted

// Makes a folder and those above it. Exit 5.
util::Result<void> make_folder(const std::string& folder);

// How long to wait for a lock that another process holds: on a network a dead one's stays until the
// server gives it up.
struct LockWait {
  double seconds = 0.0;
  bool other_shards = false;  // else only for a lock of the same shard
};

// Held while a shard runs; gone with the process, however it ends.
class RunLock {
 public:
  // Exit 5 where another run holds this shard's lock, or one of another division of the job, and
  // does so for longer than may be waited; the message names it. A task of Slurm does not wait for
  // another task, only for an earlier run of itself. Where the file system has no locks, a warning.
  static util::Result<RunLock> acquire(const std::string& output_folder, const Shard& shard,
                                       const LockWait& wait);
  RunLock(RunLock&& other) noexcept;
  RunLock& operator=(RunLock&&) = delete;
  ~RunLock();

 private:
  explicit RunLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

// What the journals of a folder say about a shard of a plan.
struct Done {
  std::uint64_t begin = 0;             // the shard's first view
  std::vector<bool> views;             // of the shard, from `begin`
  std::vector<bool> scenes_described;  // this shard's journal has the scene's line
  std::uint64_t count = 0;             // of the shard's views that are done
  std::uint64_t broken_lines = 0;
  bool has_journal = false;  // this shard's own, with its header
  bool clean = true;         // every journal that was read ends in good order: nothing was killed

  bool has(std::uint64_t view) const { return views[view - begin]; }
};

// Reads this shard's journal and those of other divisions of the job; of the other shards of this
// division, which hold none of its views, the first line of one. A view counts when its files are
// there with the sizes that its line says. A usage error where a journal belongs to another job
// than `meaning`: says what changed.
util::Result<Done> read_done(const Plan& plan, const nlohmann::ordered_json& meaning,
                             const Shard& shard);
// The same error, from the first line of every journal.
util::Result<void> check_same_job(const Plan& plan, const nlohmann::ordered_json& meaning);

// --force: forgets this shard's journal, and those of other jobs or divisions.
util::Result<void> forget(const Plan& plan, const nlohmann::ordered_json& meaning,
                          const Shard& shard);

// Removes temporary files that a killed run of this shard left, and no other's.
void remove_leftovers(const Plan& plan, const Shard& shard);
// The same for the files that are made from all journals.
void remove_result_leftovers(const Plan& plan);

}  // namespace octrace::batch
