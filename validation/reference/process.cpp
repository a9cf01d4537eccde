#include "validation/reference/process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <thread>

namespace octrace::validation {
namespace {

using Clock = std::chrono::steady_clock;
using util::Error;
using util::Exit;
using util::Result;

constexpr auto kPoll = std::chrono::milliseconds(10);
constexpr auto kGrace = std::chrono::seconds(1);  // between SIGTERM and SIGKILL
constexpr std::size_t kTailBytes = 4096;

bool runnable(const std::string& path) {
  struct stat status = {};
  return ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) &&
         ::access(path.c_str(), X_OK) == 0;
}

struct Descriptor {
  int value = -1;
  ~Descriptor() {
    if (value >= 0) ::close(value);
  }
};

// Runs between fork and exec in a process that may have had many threads: only calls that are
// async-signal-safe.
[[noreturn]] void become(const char* program, char* const* arguments, const char* folder, int input,
                         int log, int failure) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlive octrace, however that ends
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::dup2(input, STDIN_FILENO);
  ::dup2(log, STDOUT_FILENO);
  ::dup2(log, STDERR_FILENO);
  ::close_range(3, ~0u, CLOSE_RANGE_CLOEXEC);
  if (folder[0] == '\0' || ::chdir(folder) == 0) ::execv(program, arguments);
  const int error = errno;
  [[maybe_unused]] const auto written = ::write(failure, &error, sizeof error);
  ::_exit(127);
}

// True once the process has ended; it is left to be reaped, so that its group id stays its own.
bool ended(pid_t pid) {
  siginfo_t info = {};
  return ::waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT | WNOHANG) != 0 ||
         info.si_pid == pid;
}

void wait_until(pid_t pid, Clock::time_point deadline, const std::atomic<bool>* cancel) {
  while (!ended(pid) && Clock::now() < deadline && !(cancel && cancel->load())) {
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace

Result<std::string> find_program(const std::string& name) {
  if (name.empty()) return Error{Exit::usage, "", "no program was named", "", ""};
  if (name.find('/') != std::string::npos) {
    if (runnable(name)) return name;
    return Error{Exit::unsupported, "", "is not a program that can be run", name, ""};
  }
  const char* variable = std::getenv("PATH");
  const std::string path = variable ? variable : "/usr/local/bin:/usr/bin:/bin";
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find(':', begin), path.size());
    const std::string folder = path.substr(begin, end - begin);
    const std::string candidate = (folder.empty() ? "." : folder) + "/" + name;
    if (runnable(candidate)) return candidate;
    begin = end + 1;
  }
  return Error{Exit::unsupported, "",
               fmt::format("program '{}' was not found on PATH ({})", name, path), "", ""};
}

Result<ProcessResult> run_process(const Command& command) {
  if (command.arguments.empty()) return Error{Exit::internal, "", "empty command", "", ""};
  auto program = find_program(command.arguments[0]);
  if (!program) return program.error();

  Descriptor log{::open(command.log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)};
  if (log.value < 0) return Error{Exit::io, "", std::strerror(errno), command.log, ""};
  Descriptor input{::open("/dev/null", O_RDONLY | O_CLOEXEC)};
  int ends[2];
  if (input.value < 0 || ::pipe2(ends, O_CLOEXEC) != 0) {
    return Error{Exit::io, "", fmt::format("cannot start: {}", std::strerror(errno)), *program, ""};
  }
  Descriptor failure_read{ends[0]}, failure_write{ends[1]};

  std::vector<char*> arguments;
  for (const std::string& argument : command.arguments) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);

  const auto start = Clock::now();
  const pid_t pid = ::fork();
  if (pid < 0) {
    return Error{Exit::io, "", fmt::format("cannot start: {}", std::strerror(errno)), *program, ""};
  }
  if (pid == 0) {
    become(program->c_str(), arguments.data(), command.folder.c_str(), input.value, log.value,
           failure_write.value);
  }
  ::setpgid(pid, pid);  // by both, so that neither must wait for the other
  ::close(failure_write.value);
  failure_write.value = -1;

  int exec_error = 0;
  if (::read(failure_read.value, &exec_error, sizeof exec_error) ==
      static_cast<ssize_t>(sizeof exec_error)) {
    ::waitpid(pid, nullptr, 0);
    return Error{Exit::io, "", fmt::format("cannot start: {}", std::strerror(exec_error)), *program,
                 ""};
  }

  ProcessResult result;
  wait_until(pid, start + command.timeout, command.cancel);
  if (!ended(pid)) {
    result.cancelled = command.cancel && command.cancel->load();
    result.timed_out = !result.cancelled;
    ::kill(-pid, SIGTERM);
    wait_until(pid, Clock::now() + kGrace, nullptr);
  }
  ::kill(-pid, SIGKILL);  // and whatever it left running
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  result.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  result.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  return result;
}

std::string log_tail(const std::string& path, int lines) {
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  if (!stream) return "";
  const std::streamoff size = stream.tellg();
  const std::streamoff begin = std::max<std::streamoff>(0, size - kTailBytes);
  std::string text(static_cast<std::size_t>(size - begin), '\0');
  stream.seekg(begin);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  for (char& c : text) {
    if (c == '\r') c = '\n';  // progress bars
    if ((c < ' ' && c != '\n' && c != '\t') || c == 0x7f) c = '?';
  }
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::size_t from = text.size();
  for (int i = 0; i < lines && from != std::string::npos && from > 0; ++i) {
    from = text.rfind('\n', from - 1);
  }
  return from == std::string::npos || from == 0 ? text : text.substr(from + 1);
}

Error process_error(const std::string& title, const Command& command, const ProcessResult& result) {
  std::string what;
  if (result.cancelled) {
    what = "was interrupted";
  } else if (result.timed_out) {
    what = fmt::format("was stopped after its time limit of {:.3g} s",
                       std::chrono::duration<double>(command.timeout).count());
  } else if (result.exit_code > 128) {
    what = fmt::format("was killed by signal {} (exit code {})", result.exit_code - 128,
                       result.exit_code);
  } else {
    what = fmt::format("failed with exit code {}", result.exit_code);
  }
  const std::string tail = log_tail(command.log);
  return {
      Exit::io, "",
      fmt::format("{} ({}) {}{}", title, command.arguments.empty() ? "" : command.arguments[0],
                  what, tail.empty() ? "; it wrote no log" : "; last lines of its log:\n" + tail),
      "", ""};
}

}  // namespace octrace::validation
