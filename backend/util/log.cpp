#include "backend/util/log.h"

#include <fmt/format.h>

#include <atomic>
#include <cstdio>
#include <mutex>
#include <set>
#include <string>

namespace octrace::util {

namespace {

std::atomic<Verbosity> current{Verbosity::normal};
std::mutex mutex;

void print(std::string_view kind, std::string_view message) {
  // One write a line, so that lines of several threads do not mix.
  const std::string line = fmt::format("octrace: {}{}\n", kind, message);
  std::lock_guard lock(mutex);
  std::fwrite(line.data(), 1, line.size(), stderr);
}

}  // namespace

void set_verbosity(Verbosity verbosity) { current = verbosity; }
Verbosity verbosity() { return current; }

void log_error(std::string_view message) { print("error: ", message); }

void log_warning(std::string_view message) {
  if (current == Verbosity::quiet) return;
  static std::set<std::string, std::less<>> seen;
  {
    std::lock_guard lock(mutex);
    if (!seen.emplace(message).second) return;
  }
  print("warning: ", message);
}

void log_info(std::string_view message) {
  if (current != Verbosity::quiet) print("", message);
}

void log_verbose(std::string_view message) {
  if (current == Verbosity::verbose) print("", message);
}

}  // namespace octrace::util
