// Files that are flushed a folder at a time instead of each by itself.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "backend/util/atomic_file.h"
#include "backend/util/result.h"

namespace octrace::util {

// While one lives, files that its thread commits (atomic_file.h) are flushed and renamed, at once
// or by finish(), and the caller flushes their folder: a rename survives a power cut only when its
// folder is flushed too. Of the thread and not a parameter, because files are committed below
// layers to which flushing means nothing. One at a time on a thread.
class GroupedCommit {
 public:
  enum class When { at_once, by_finish };
  explicit GroupedCommit(When when = When::at_once);
  GroupedCommit(const GroupedCommit&) = delete;
  GroupedCommit& operator=(const GroupedCommit&) = delete;
  ~GroupedCommit();
  static GroupedCommit* of_this_thread();  // or null

  // Flushes and renames the files that wait, and stops at the first error; those that are left
  // vanish.
  Result<void> finish();

  bool waits() const { return when_ == When::by_finish && !finishing_; }
  void add(AtomicFile file) { files_.push_back(std::move(file)); }
  void add(double milliseconds) { milliseconds_ += milliseconds; }
  double milliseconds() const { return milliseconds_; }  // that flushing and renaming took

 private:
  const When when_;
  bool finishing_ = false;
  std::vector<AtomicFile> files_;
  double milliseconds_ = 0.0;
};

// "": the current folder. A file system that cannot flush a folder is no error.
void flush_folder(const std::string& folder);

// Runs all of what commits files, at the same time: one after the other, each would wait for the
// disk. The caller flushes their folder. Returns the first error in the order of the list.
Result<void> commit_together(const std::vector<std::function<Result<void>()>>& commits);

}  // namespace octrace::util
