#include "backend/util/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>

#include "backend/util/grouped_commit.h"
#include "backend/util/interrupt.h"
#include "backend/util/process.h"

namespace octrace::util {

namespace {

// In the names of temporary files, so that what a killed run left behind can be told apart.
constexpr std::string_view kMark = ".octrace-";

Error io_error(const std::string& file, std::string_view what, int error_number) {
  return {Exit::io, "IO_ERROR", fmt::format("{}: {}", what, std::strerror(error_number)), file, ""};
}

bool write_all(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(descriptor, content.data(), content.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return false;
    }
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// umask() cannot be asked without being set, and of two threads that set it and set it back one may
// leave the other's 0 behind. Only where /proc does not say it (Linux before 4.7) it is set, by one
// thread at a time.
mode_t process_umask() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("Umask:"))
      return static_cast<mode_t>(std::stoul(line.substr(6), nullptr, 8));
  }
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  const mode_t mask = ::umask(0);
  ::umask(mask);
  return mask;
}

}  // namespace

Result<AtomicFile> AtomicFile::create(const std::string& target) {
  std::filesystem::path path(target);
  std::error_code ignored;
  if (path.filename().empty() || std::filesystem::is_directory(path, ignored)) {
    return Error{Exit::io, "IO_ERROR", "is a folder, a file name was needed", target, ""};
  }
  // A rename would put a file in the place of /dev/null, and break a link instead of following it.
  if (std::filesystem::exists(path, ignored)) {
    if (!std::filesystem::is_regular_file(path, ignored)) {
      return Error{Exit::io, "IO_ERROR", "is a device or the like, a file was needed", target, ""};
    }
    if (std::filesystem::is_symlink(path, ignored))
      path = std::filesystem::canonical(path, ignored);
  }
  // The leading dot hides it from patterns such as *.exr; mkstemps fills in the Xs.
  const std::string extension = path.extension().string();
  std::string temporary =
      (path.parent_path() / fmt::format(".{}{}XXXXXX{}", path.stem().string(), kMark, extension))
          .string();
  const int descriptor = ::mkstemps(temporary.data(), static_cast<int>(extension.size()));
  if (descriptor < 0) {
    const int error = errno;
    const std::filesystem::path folder = path.parent_path();
    if (error == ENOENT && !folder.empty() && !std::filesystem::exists(folder, ignored)) {
      return Error{Exit::io, "IO_ERROR",
                   fmt::format("cannot be created: there is no folder {}", folder.string()), target,
                   ""};
    }
    return io_error(target, "cannot be created", error);
  }
  ::fchmod(descriptor, 0666 & ~process_umask());  // mkstemps makes 0600
  ::close(descriptor);
  return AtomicFile(path.string(), std::move(temporary));
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : target_(std::move(other.target_)), temporary_(std::exchange(other.temporary_, {})) {}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

Result<void> AtomicFile::commit() {
  if (interrupt_flag()) return Error{Exit::io, "", "not written: interrupted", target_, ""};
  GroupedCommit* const group = GroupedCommit::of_this_thread();
  if (group != nullptr && group->waits()) {
    group->add(std::move(*this));
    return {};
  }
  const Timer timer;
  const int descriptor = ::open(temporary_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return io_error(target_, "cannot be reopened", errno);
  const int flushed = ::fsync(descriptor);
  const int error_number = errno;
  ::close(descriptor);
  if (flushed != 0) return io_error(target_, "cannot be flushed", error_number);
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) {
    return io_error(target_, "cannot be renamed into place", errno);
  }
  temporary_.clear();
  // The rename itself survives a power cut only when the folder is flushed too.
  if (group == nullptr) {
    flush_folder(std::filesystem::path(target_).parent_path().string());
  } else {
    group->add(timer.milliseconds());
  }
  return {};
}

std::optional<std::string> target_of_temporary(std::string_view name) {
  const std::size_t mark = name.rfind(kMark);
  if (!name.starts_with('.') || mark == std::string_view::npos || mark == 0) return std::nullopt;
  const std::string_view rest = name.substr(mark + kMark.size());
  if (rest.size() < 6 || (rest.size() > 6 && rest[6] != '.')) return std::nullopt;
  return std::string(name.substr(1, mark - 1)) + std::string(rest.substr(6));
}

Result<void> write_file(const std::string& target, std::string_view content) {
  Result<AtomicFile> file = AtomicFile::create(target);
  if (!file) return file.error();
  const int descriptor = ::open(file->temporary().c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (descriptor < 0) return io_error(target, "cannot be opened", errno);
  const bool written = write_all(descriptor, content);
  const int error_number = errno;
  const bool closed = ::close(descriptor) == 0;
  if (!written || !closed) return io_error(target, "cannot be written", error_number);
  return file->commit();
}

}  // namespace octrace::util
