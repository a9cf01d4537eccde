#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>

#include "backend/batch/state.h"
#include "backend/util/log.h"

namespace octrace::batch {

namespace {

using util::Result;

constexpr std::string_view kPrefix = "lock-";

struct flock whole_file(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

// "process 123 on node4 since 2026-11-24 08:00:00 UTC", as far as the file tells.
std::string holder(int descriptor) {
  std::array<char, 1024> text{};
  const ssize_t got = ::pread(descriptor, text.data(), text.size() - 1, 0);
  const auto json = nlohmann::json::parse(
      std::string(text.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))), nullptr,
      false);
  if (!json.is_object() || !json.contains("pid") || !json["pid"].is_number() ||
      !json.contains("host") || !json["host"].is_string()) {
    return "another process";
  }
  std::string text_of = fmt::format("process {} on {}", json["pid"].get<std::int64_t>(),
                                    json["host"].get<std::string>());
  if (json.contains("since") && json["since"].is_string()) {
    text_of += " since " + json["since"].get<std::string>();
  }
  return text_of;
}

util::Error busy(const std::string& path, const std::string& who) {
  return {util::Exit::io, "LOCKED",
          fmt::format("{} is rendering into this folder; wait for it, or end it", who), path, ""};
}

// Shards of another division of the job would render the same views.
Result<void> check_others(const std::string& folder, const Shard& shard) {
  const std::string division = fmt::format("-of-{}", shard.count);
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix) || name.ends_with(division)) continue;
    const int descriptor = ::open(entry.path().c_str(), O_RDWR | O_CLOEXEC);
    if (descriptor < 0) continue;
    struct flock lock = whole_file(F_WRLCK);
    const bool held = ::fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
    const std::string who = held ? holder(descriptor) : "";
    ::close(descriptor);
    if (held) return busy(entry.path().string(), who);
  }
  return {};
}

}  // namespace

Result<RunLock> RunLock::acquire(const std::string& output_folder, const Shard& shard) {
  const std::string folder = state_folder(output_folder);
  const std::string path = fmt::format("{}{}{}-of-{}", folder, kPrefix, shard.index, shard.count);
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    return util::Error{util::Exit::io, "IO_ERROR",
                       fmt::format("cannot be opened: {}", std::strerror(errno)), path, ""};
  }
  RunLock lock(descriptor);
  struct flock whole = whole_file(F_WRLCK);
  if (::fcntl(descriptor, F_OFD_SETLK, &whole) != 0) {
    if (errno == EAGAIN || errno == EACCES) return busy(path, holder(descriptor));
    util::log_warning(fmt::format(
        "{}: this file system has no locks ({}): make sure that no other run uses the folder", path,
        std::strerror(errno)));
    return lock;
  }
  // Own lock first, then the others': of two that start at once none can miss the other.
  if (auto checked = check_others(folder, shard); !checked) return checked.error();
  const nlohmann::ordered_json who = {
      {"host", host_name()},
      {"pid", ::getpid()},
      {"since",
       fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::chrono::system_clock::to_time_t(
                                                   std::chrono::system_clock::now())))}};
  const std::string text = who.dump() + "\n";
  // A full disk must not stop a run here: what it says only serves the message to another.
  if (::ftruncate(descriptor, 0) == 0 && ::pwrite(descriptor, text.data(), text.size(), 0) < 0) {
    util::log_verbose(fmt::format("{}: {}", path, std::strerror(errno)));
  }
  return lock;
}

RunLock::RunLock(RunLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

RunLock::~RunLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace octrace::batch
