#include "tests/cli/driver.h"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace octrace::test {

namespace {

struct Channel {
  int read_end = -1, write_end = -1;
};

Channel open_channel(bool terminal) {
  std::array<int, 2> ends{};
  const int failed =
      terminal ? ::openpty(&ends[0], &ends[1], nullptr, nullptr, nullptr) : ::pipe(ends.data());
  if (failed != 0) throw std::runtime_error("no pipe");
  ::fcntl(ends[0], F_SETFD, FD_CLOEXEC);
  return {ends[0], ends[1]};
}

[[noreturn]] void become(const Launch& launch, const std::string& program, int out, int err) {
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(err, STDERR_FILENO);
  if (launch.largest_file) {
    const struct rlimit limit { *launch.largest_file, *launch.largest_file };
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  if (!launch.folder.empty() && ::chdir(launch.folder.c_str()) != 0) ::_exit(126);
  std::vector<char*> arguments{const_cast<char*>(program.c_str())};
  for (const std::string& argument : launch.arguments) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  ::execv(program.c_str(), arguments.data());
  ::_exit(127);
}

// Both at once: a program that fills one pipe while we wait on the other would hang.
void drain(int out, int err, Outcome& outcome) {
  std::array<struct pollfd, 2> waiting = {{{out, POLLIN, 0}, {err, POLLIN, 0}}};
  std::array<std::string*, 2> texts = {&outcome.out, &outcome.err};
  int open = 2;
  while (open > 0) {
    if (::poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) return;
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      if (waiting[i].fd < 0 || waiting[i].revents == 0) continue;
      std::array<char, 4096> buffer;
      const ssize_t got = ::read(waiting[i].fd, buffer.data(), buffer.size());
      if (got > 0) {
        texts[i]->append(buffer.data(), static_cast<std::size_t>(got));
      } else if (got == 0 || errno != EINTR) {  // a closed terminal reads as EIO
        ::close(waiting[i].fd);
        waiting[i].fd = -1;
        --open;
      }
    }
  }
}

}  // namespace

Outcome run(const Launch& launch) {
  const std::string program = launch.program.empty() ? OCTRACE_PROGRAM : launch.program;
  Channel out = open_channel(false);
  const Channel err = open_channel(launch.terminal);
  if (!launch.out_path.empty()) {
    ::close(out.write_end);
    out.write_end = ::open(launch.out_path.c_str(), O_WRONLY | O_CREAT, 0666);
  }
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("no process");
  if (child == 0) become(launch, program, out.write_end, err.write_end);
  ::close(out.write_end);
  ::close(err.write_end);
  if (launch.while_running) launch.while_running(child);
  Outcome outcome;
  drain(out.read_end, err.read_end, outcome);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

Outcome run(const std::vector<std::string>& arguments) {
  Launch launch;
  launch.arguments = arguments;
  return run(launch);
}

Scratch::Scratch() {
  std::string name = (std::filesystem::temp_directory_path() / "octrace_cli_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no scratch folder");
  folder_ = name;
}

Scratch::~Scratch() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

std::vector<std::string> Scratch::files() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace octrace::test
