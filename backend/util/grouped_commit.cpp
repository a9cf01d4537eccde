#include "backend/util/grouped_commit.h"

#include <fcntl.h>
#include <unistd.h>

namespace octrace::util {

namespace {

thread_local GroupedCommit* current = nullptr;

}  // namespace

GroupedCommit::GroupedCommit() { current = this; }

GroupedCommit::~GroupedCommit() { current = nullptr; }

GroupedCommit* GroupedCommit::of_this_thread() { return current; }

void flush_folder(const std::string& folder) {
  const int descriptor =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace octrace::util
