#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <thread>

#include "backend/batch/state.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"
#include "backend/util/process.h"

namespace octrace::batch {

namespace {

using util::Result;

constexpr std::string_view kPrefix = "lock-";
constexpr std::chrono::milliseconds kLockPoll(250);

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

// What Slurm calls this process, the same after a requeue; empty: it is no task of Slurm.
std::string task_name() {
  const char* job = std::getenv("SLURM_JOB_ID");
  const char* cluster = std::getenv("SLURM_CLUSTER_NAME");
  if (job == nullptr) return "";
  return fmt::format("slurm {} {}", cluster != nullptr ? cluster : "", job);
}

struct Holder {
  std::string text = "another process";  // "process 123 on node4 since 2026-11-24 08:00:00 UTC"
  std::string task;                      // as task_name()
};

// As far as the file tells.
Holder read_holder(int descriptor) {
  std::array<char, 1024> text{};
  const ssize_t got = ::pread(descriptor, text.data(), text.size() - 1, 0);
  const auto json = nlohmann::json::parse(
      std::string(text.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))), nullptr,
      false);
  Holder holder;
  if (!json.is_object() || !json.contains("pid") || !json["pid"].is_number() ||
      !json.contains("host") || !json["host"].is_string()) {
    return holder;
  }
  holder.text = fmt::format("process {} on {}", json["pid"].get<std::int64_t>(),
                            json["host"].get<std::string>());
  if (json.contains("since") && json["since"].is_string()) {
    holder.text += " since " + json["since"].get<std::string>();
  }
  if (json.contains("task") && json["task"].is_string()) holder.task = json["task"];
  return holder;
}

// A lock that another process holds.
struct Busy {
  std::string path;
  Holder holder;
  bool same_shard = false;

  bool worth_waiting(const LockWait& wait) const {
    if (wait.other_shards) return true;
    const std::string task = task_name();
    return same_shard && (task.empty() || holder.task.empty() || task == holder.task);
  }
  util::Error error(double waited) const {
    return {util::Exit::io, "LOCKED",
            fmt::format("{} is rendering into this folder; wait for it, or end it{}", holder.text,
                        waited >= 1.0 ? fmt::format(" ({:.0f} s waited)", waited) : ""),
            path, ""};
  }
};

// Shards of another division of the job would render the same views.
std::optional<Busy> find_other(const std::string& folder, const Shard& shard) {
  const std::string division = fmt::format("-of-{}", shard.count);
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix) || name.ends_with(division)) continue;
    const int descriptor = ::open(entry.path().c_str(), O_RDWR | O_CLOEXEC);
    if (descriptor < 0) continue;
    struct flock lock = whole_file(F_WRLCK);
    const bool held = ::fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
    Busy busy{entry.path().string(), held ? read_holder(descriptor) : Holder(), false};
    ::close(descriptor);
    if (held) return busy;
  }
  return {};
}

void write_holder(int descriptor, const std::string& path) {
  nlohmann::ordered_json who = {
      {"host", host_name()},
      {"pid", ::getpid()},
      {"since",
       fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::chrono::system_clock::to_time_t(
                                                   std::chrono::system_clock::now())))}};
  if (const std::string task = task_name(); !task.empty()) who["task"] = task;
  const std::string text =
      who.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  // A full disk must not stop a run here: what it says only serves the message to another.
  if (::ftruncate(descriptor, 0) == 0 && ::pwrite(descriptor, text.data(), text.size(), 0) < 0) {
    util::log_verbose(fmt::format("{}: {}", path, std::strerror(errno)));
  }
}

}  // namespace

Result<RunLock> RunLock::acquire(const std::string& output_folder, const Shard& shard,
                                 const LockWait& wait) {
  const std::string folder = state_folder(output_folder);
  const std::string path = fmt::format("{}{}{}-of-{}", folder, kPrefix, shard.index, shard.count);
  const util::Timer timer;
  for (bool told = false;;) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor < 0) {
      return util::Error{util::Exit::io, "IO_ERROR",
                         fmt::format("cannot be opened: {}", std::strerror(errno)), path, ""};
    }
    std::optional<Busy> busy;
    {
      RunLock lock(descriptor);
      struct flock whole = whole_file(F_WRLCK);
      if (::fcntl(descriptor, F_OFD_SETLK, &whole) == 0) {
        // Own lock first, then the others': of two that start at once none can miss the other.
        busy = find_other(folder, shard);
        if (!busy) {
          if (told) util::log_info(fmt::format("the lock is free after {:.1f} s", timer.seconds()));
          write_holder(descriptor, path);
          return lock;
        }
      } else if (errno == EAGAIN || errno == EACCES) {
        busy = Busy{path, read_holder(descriptor), true};
      } else {
        util::log_warning(fmt::format(
            "{}: this file system has no locks ({}): make sure that no other run uses the folder",
            path, std::strerror(errno)));
        return lock;
      }
    }
    const double waited = timer.seconds();
    if (waited >= wait.seconds || !busy->worth_waiting(wait) || util::interrupt_flag()) {
      return busy->error(waited);
    }
    if (!told) {
      util::log_info(fmt::format("waiting up to {:.0f} s: {} holds {}", wait.seconds,
                                 busy->holder.text, busy->path));
    }
    told = true;
    std::this_thread::sleep_for(kLockPoll);
  }
}

RunLock::RunLock(RunLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

RunLock::~RunLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace octrace::batch
