#include "backend/util/grouped_commit.h"

#include <fcntl.h>
#include <unistd.h>

#include <future>
#include <system_error>

namespace octrace::util {

namespace {

thread_local GroupedCommit* current = nullptr;

}  // namespace

GroupedCommit::GroupedCommit(When when) : when_(when) { current = this; }

GroupedCommit::~GroupedCommit() { current = nullptr; }

Result<void> GroupedCommit::finish() {
  finishing_ = true;
  Result<void> result;
  for (AtomicFile& file : files_) {
    if (result = file.commit(); !result) break;
  }
  files_.clear();
  finishing_ = false;
  return result;
}

GroupedCommit* GroupedCommit::of_this_thread() { return current; }

void flush_folder(const std::string& folder) {
  const int descriptor =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

Result<void> commit_together(const std::vector<std::function<Result<void>()>>& commits) {
  std::vector<std::future<Result<void>>> running;
  for (const auto& commit : commits) {
    const auto run = [&commit] {
      const GroupedCommit group;
      return commit();
    };
    try {
      running.push_back(std::async(std::launch::async, run));
    } catch (const std::system_error&) {  // no more threads are to be had: one after the other
      running.push_back(std::async(std::launch::deferred, run));
    }
  }
  Result<void> result;
  for (auto& one : running) {
    Result<void> committed = one.get();
    if (result && !committed) result = std::move(committed);
  }
  return result;
}

}  // namespace octrace::util
