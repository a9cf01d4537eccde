#include "validation/reference/version.h"

#include <fstream>

#include "validation/reference/process.h"
#include "validation/reference/scratch.h"

namespace octrace::validation {

util::Result<ProgramVersion> program_version(const std::string& program) {
  auto path = find_program(program);
  if (!path) return path.error();
  auto scratch = Scratch::create("octrace-version");
  if (!scratch) return scratch.error();
  Command command;
  command.arguments = {*path, "--version"};
  command.folder = scratch->path();
  command.log = scratch->file("log");
  command.timeout = std::chrono::seconds(30);
  auto result = run_process(command);
  if (!result) return result.error();
  if (result->exit_code != 0 || result->timed_out) {
    return process_error(program + " --version", command, *result);
  }
  std::ifstream stream(command.log);
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("POV-Ray") || line.starts_with("Blender")) {
      return ProgramVersion{*path, line};
    }
  }
  return ProgramVersion{*path, "unknown version: " + log_tail(command.log, 1)};
}

}  // namespace octrace::validation
