#include "backend/batch/scratch_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

namespace octrace::batch {

namespace {

util::Error io_error(const std::string& path, std::string_view what) {
  return {util::Exit::io, "IO_ERROR", fmt::format("{}: {}", what, std::strerror(errno)), path, ""};
}

constexpr std::string_view kPrefix = "octrace-batch-";

std::filesystem::path lock_in(const std::filesystem::path& folder) { return folder / "lock"; }

// The locked file, or -1 where another process has locked it or it cannot be opened.
int lock_file(const std::filesystem::path& path, int flags) {
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
  if (file < 0 || ::flock(file, LOCK_EX | LOCK_NB) == 0) return file;
  ::close(file);
  return -1;
}

bool is_own_folder(const std::filesystem::path& path) {
  struct stat status {};
  return ::lstat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         status.st_uid == ::geteuid();
}

void remove_left_behind(const std::filesystem::path& place) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry(place, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::filesystem::path& path = entry->path();
    if (!path.filename().string().starts_with(kPrefix) || !is_own_folder(path)) continue;
    const int lock = lock_file(lock_in(path), 0);
    if (lock < 0) continue;
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
    ::close(lock);
  }
}

}  // namespace

util::Result<ScratchFolder> ScratchFolder::create() {
  std::error_code error;
  std::filesystem::path place = std::filesystem::temp_directory_path(error);
  if (error) place = "/tmp";
  remove_left_behind(place);
  while (true) {
    std::string path = place / fmt::format("{}XXXXXX", kPrefix);
    if (::mkdtemp(path.data()) == nullptr) return io_error(path, "the folder cannot be made");
    const int lock = lock_file(lock_in(path), O_CREAT);
    const int error_number = errno;
    // Another process that makes a folder may have found the file before it was locked.
    if (lock >= 0 && std::filesystem::exists(lock_in(path), error)) {
      return ScratchFolder(path + "/", lock);
    }
    if (lock >= 0) ::close(lock);
    std::filesystem::remove_all(path, error);
    if (lock < 0 && error_number != EWOULDBLOCK) {
      errno = error_number;
      return io_error(path, "the folder cannot be locked");
    }
  }
}

ScratchFolder::ScratchFolder(ScratchFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})), lock_(std::exchange(other.lock_, -1)) {}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  if (lock_ >= 0) ::close(lock_);
}

util::Result<std::string> take_file(const std::string& path) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  std::string content(error ? 0 : bytes, '\0');
  if (error || !file.read(content.data(), static_cast<std::streamsize>(bytes))) {
    return io_error(path, "cannot be read");
  }
  std::filesystem::remove(path, error);
  return content;
}

}  // namespace octrace::batch
