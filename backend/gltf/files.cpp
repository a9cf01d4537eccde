#include "backend/gltf/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>

#include "backend/gltf/issues.h"
#include "backend/util/heap.h"

namespace octrace::gltf {
namespace {

using Bytes = std::vector<std::uint8_t>;

util::Error io_error(std::string message) {
  return {util::Exit::io, "IO_ERROR", std::move(message), "", ""};
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

std::optional<std::string> canonical(const std::string& path) {
  const std::unique_ptr<char, decltype(&std::free)> resolved(::realpath(path.c_str(), nullptr),
                                                             &std::free);
  if (!resolved) return std::nullopt;
  return std::string(resolved.get());
}

bool is_below(const std::string& path, const std::string& folder) {
  if (folder == "/") return true;
  return path.size() > folder.size() && path.starts_with(folder) && path[folder.size()] == '/';
}

constexpr std::uint64_t kLargeFile = 1u << 20;
constexpr std::uint64_t kMostPrepared = 31u << 20;  // larger blocks are not of the heap

util::Result<Bytes> read_open(const Descriptor& file, std::uint64_t max_bytes,
                              std::uint64_t wanted) {
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) return io_error(std::strerror(errno));
  if (S_ISDIR(status.st_mode)) return io_error("is a folder, needs a regular file");
  if (!S_ISREG(status.st_mode)) return io_error("is not a regular file");
  const auto size = static_cast<std::uint64_t>(std::max<off_t>(status.st_size, 0));
  if (size > max_bytes) {
    return util::Error{
        util::Exit::limit, "LIMIT",
        fmt::format("the file has {} bytes, --max-file-bytes allows {}", size, max_bytes), "", ""};
  }
  const std::uint64_t count = std::min(size, wanted);
  // What is made of a large file takes several times its size, most of it in pieces that the heap
  // would grow for by small pages: their faults took most of the time to load a scene.
  if (count >= kLargeFile) util::prepare_heap(6 * std::min(count, kMostPrepared / 6));
  Bytes bytes(count);
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::read(file.get(), bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return io_error(std::strerror(errno));
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace

// O_NONBLOCK: opening a FIFO must not wait for a writer.
util::Result<Bytes> read_regular_file(const std::string& path, std::uint64_t max_bytes,
                                      std::uint64_t wanted) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (file.get() < 0) return io_error(std::strerror(errno));
  return read_open(file, max_bytes, wanted);
}

SceneFolder SceneFolder::of(const std::string& scene_path) {
  SceneFolder folder;
  const std::size_t slash = scene_path.rfind('/');
  std::string parent = ".";
  if (slash == 0) parent = "/";
  if (slash != std::string::npos && slash > 0) parent = scene_path.substr(0, slash);
  folder.canonical_ = canonical(parent).value_or("");
  return folder;
}

util::Result<Bytes> SceneFolder::read(const std::string& relative, std::uint64_t max_bytes,
                                      std::uint64_t wanted) const {
  if (canonical_.empty()) {
    return io_error(fmt::format("{}: the scene has no folder to read from", quote(relative)));
  }
  const auto leaves = [&] {
    return util::Error{util::Exit::invalid_input, "INVALID_URI",
                       fmt::format("{} is a link that leaves the scene's folder", quote(relative)),
                       "", ""};
  };
  const auto path = canonical(canonical_ + "/" + relative);
  if (!path) return io_error(fmt::format("{}: {}", quote(relative), std::strerror(errno)));
  if (!is_below(*path, canonical_)) return leaves();
  const Descriptor file(
      ::open(path->c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | O_NOFOLLOW));
  if (file.get() < 0) return io_error(fmt::format("{}: {}", quote(relative), std::strerror(errno)));
  // A folder on the way may have become a link since; the open file's own path cannot change hands.
  const auto opened = canonical(fmt::format("/proc/self/fd/{}", file.get()));
  if (opened && !is_below(*opened, canonical_)) return leaves();
  auto bytes = read_open(file, max_bytes, wanted);
  if (!bytes) bytes.error().message = quote(relative) + ": " + bytes.error().message;
  return bytes;
}

}  // namespace octrace::gltf
