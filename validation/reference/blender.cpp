#include <fmt/format.h>

#include <fstream>

#include "validation/reference/output.h"
#include "validation/reference/process.h"
#include "validation/reference/reference.h"

namespace octrace::validation {
namespace {

// The script's own words about what failed say more than the last lines of a log of many views.
std::string failures(const std::string& log) {
  std::ifstream stream(log);
  std::string text;
  for (std::string line; std::getline(stream, line) && text.size() < 2000;) {
    if (line.starts_with("octrace: failed")) text += (text.empty() ? "" : "\n") + line;
  }
  return text;
}

}  // namespace

util::Result<std::vector<util::Result<Planes>>> run_blender(const BlenderJob& job,
                                                            const ProgramOptions& options) {
  for (const BlenderView& view : job.views) {
    if (auto removed = remove_output(view.output); !removed) return removed.error();
  }
  Command command;
  command.arguments.push_back(options.program);
  if (options.threads > 0) {
    command.arguments.insert(command.arguments.end(), {"-t", fmt::format("{}", options.threads)});
  }
  command.arguments.insert(command.arguments.end(), job.arguments.begin(), job.arguments.end());
  command.folder = job.folder;
  command.log = job.folder + "/blender.log";
  command.timeout = options.timeout;
  command.cancel = options.cancel;
  auto result = run_process(command);
  if (!result) return result.error();

  const bool failed = result->timed_out || result->cancelled || result->exit_code != 0;
  const util::Error failure = process_error("Blender", command, *result);
  const std::string reasons = failures(command.log);
  std::vector<util::Result<Planes>> planes;
  for (const BlenderView& view : job.views) {
    auto image = read_output(view.output, view.width, view.height, options.limits);
    if (image) {
      planes.emplace_back(planes_from_image(*image, view.output));
      continue;
    }
    util::Error error = failed ? failure : image.error();
    if (failed && !reasons.empty()) error.message = reasons + "\n" + error.message;
    if (!failed) error.message = fmt::format("Blender ({}): {}", options.program, error.message);
    planes.emplace_back(std::move(error));
  }
  return planes;
}

}  // namespace octrace::validation
