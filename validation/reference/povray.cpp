#include <fmt/format.h>

#include "validation/reference/output.h"
#include "validation/reference/process.h"
#include "validation/reference/reference.h"

namespace octrace::validation {

util::Result<Planes> run_povray(const PovrayJob& job, const ProgramOptions& options) {
  const std::string image = job.folder + "/" + job.image;
  if (auto removed = remove_output(image); !removed) return removed.error();

  Command command;
  command.arguments.push_back(options.program);
  command.arguments.insert(command.arguments.end(), job.arguments.begin(), job.arguments.end());
  if (options.threads > 0) command.arguments.push_back(fmt::format("+WT{}", options.threads));
  command.folder = job.folder;
  command.log = image + ".log";
  command.timeout = options.timeout;
  command.cancel = options.cancel;
  auto result = run_process(command);
  if (!result) return result.error();
  if (result->timed_out || result->cancelled || result->exit_code != 0) {
    return process_error("POV-Ray", command, *result);
  }

  auto pixels = read_output(image, job.width, job.height, options.limits);
  if (!pixels) {
    util::Error error = process_error("POV-Ray", command, *result);
    error.message = pixels.error().to_string() + "; " + error.message;
    return error;
  }
  return planes_from_povray(*pixels, job.far_distance, image);
}

}  // namespace octrace::validation
