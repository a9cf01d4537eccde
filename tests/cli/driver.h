// Runs the program and says what came of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace octrace::test {

struct Outcome {
  int exit_code = -1;  // 128 + N: ended by signal N
  std::string out, err;
};

struct Launch {
  std::vector<std::string> arguments;
  std::filesystem::path folder;                // working directory; empty: this process's
  std::optional<std::uint64_t> largest_file;   // RLIMIT_FSIZE
  bool terminal = false;                       // standard error is a pseudo-terminal
  std::string out_path;                        // standard output goes there instead of into Outcome
  std::function<void(int pid)> while_running;  // called once, right after the start
  std::string program;                         // empty: octrace
};

Outcome run(const Launch& launch);
Outcome run(const std::vector<std::string>& arguments);

// A folder of this test's own, removed at the end.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  const std::filesystem::path& folder() const { return folder_; }
  std::vector<std::string> files() const;  // sorted names, hidden ones too

 private:
  std::filesystem::path folder_;
};

std::string read_text(const std::string& path);
void write_text(const std::string& path, const std::string& text);

}  // namespace octrace::test
