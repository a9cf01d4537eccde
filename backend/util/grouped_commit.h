// Files that are flushed a folder at a time instead of each by itself.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::util {

// While one lives, files that its thread commits (atomic_file.h) are flushed and renamed, and the
// caller flushes their folder: a rename survives a power cut only when its folder is flushed too.
// Of the thread and not a parameter, because files are committed below layers to which flushing
// means nothing. One at a time on a thread.
class GroupedCommit {
 public:
  GroupedCommit();
  GroupedCommit(const GroupedCommit&) = delete;
  GroupedCommit& operator=(const GroupedCommit&) = delete;
  ~GroupedCommit();
  static GroupedCommit* of_this_thread();  // or null

  void add(double milliseconds) { milliseconds_ += milliseconds; }
  double milliseconds() const { return milliseconds_; }  // that flushing and renaming took

 private:
  double milliseconds_ = 0.0;
};

// "": the current folder. A file system that cannot flush a folder is no error.
void flush_folder(const std::string& folder);

// Runs all of what commits files of one folder, at the same time, and then flushes the folder: one
// after the other, each file would wait for the disk three times. Returns the first error in the
// order of the list.
Result<void> commit_together(const std::string& folder,
                             const std::vector<std::function<Result<void>()>>& commits);

}  // namespace octrace::util
