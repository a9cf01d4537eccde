#include <fmt/format.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>
#include <vector>

#include "backend/app/command.h"
#include "backend/image/image.h"
#include "backend/util/heap.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"
#include "backend/util/version.h"

namespace octrace::app {

namespace {

using util::Exit;

constexpr const char* kExamples = R"(Examples:
  octrace render builtin:default -o picture.png
  octrace render scene.glb -o frame.exr --aov beauty,Z,mask --size 1920x1080 --spp 64
  octrace info scene.glb

"octrace COMMAND --help" explains a command's options.

Exit codes: 0 done, 1 compared and different, 2 wrong command line, 3 invalid input, 4 a feature or
program that octrace or this machine does not have, 5 reading or writing failed, 6 a limit or memory,
7 a bug in octrace, 8 some jobs of a batch failed, 128 + N ended by signal N.)";

int fail(const util::Error& error) {
  if (util::interrupt_signal() != 0) {
    util::log_error("interrupted");
    return 128 + util::interrupt_signal();
  }
  util::log_error(error.to_string());
  return static_cast<int>(error.exit);
}

int parse_failed(const CLI::App& program, const CLI::ParseError& error) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) {
    return program.exit(error);  // --help, --version
  }
  const auto commands = program.get_subcommands();
  const bool extras = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (extras && commands.empty()) {
    std::vector<std::string> names;
    for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(command->get_name());
    }
    util::log_error(fmt::format("\"{}\" is no command; there are {}",
                                program.remaining(true).front(), fmt::join(names, ", ")));
  } else if (extras) {
    util::log_error(fmt::format("not expected: {}", fmt::join(program.remaining(true), " ")));
  } else {
    util::log_error(error.what());
  }
  fmt::print(stderr, "octrace: \"octrace{}{} --help\" says what it takes\n",
             commands.empty() ? "" : " ", commands.empty() ? "" : commands.front()->get_name());
  return static_cast<int>(Exit::usage);
}

int run(int argc, char** argv) {
  CLI::App program(
      "octrace renders glTF 2.0 scenes to depth, silhouettes and shaded images by ray tracing an "
      "octree.");
  program.name("octrace");
  program.set_version_flag("--version", fmt::format("octrace {}", util::version()));
  program.require_subcommand(0, 1);  // none is reported below, after words that are no command
  program.footer(kExamples);
  Run chosen;
  declare_render(program, chosen);
  declare_info(program, chosen);
  declare_compare(program, chosen);
  declare_validate(program, chosen);
  declare_export(program, chosen);
  declare_batch(program, chosen);
  declare_submit(program, chosen);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return parse_failed(program, error);
  }
  if (!chosen) return parse_failed(program, CLI::RequiredError("a command"));
  const util::Result<Exit> outcome = chosen();
  return outcome ? static_cast<int>(*outcome) : fail(outcome.error());
}

int run_guarded(int argc, char** argv) {
  // A file that may not grow further is then an error of write(), and reported as such.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    return fail({Exit::limit, "", "out of memory", "", ""});
  } catch (const std::exception& exception) {
    return fail({Exit::internal, "", fmt::format("internal error: {}", exception.what()), "", ""});
  }
}

// Results go to standard output, and a full disk shows when it is flushed.
int flush_results(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  if (code != 0) return code;
  return fail({Exit::io, "IO_ERROR", "standard output cannot be written", "", ""});
}

}  // namespace

}  // namespace octrace::app

int main(int argc, char** argv) {
  octrace::util::keep_freed_memory();
  const int code = octrace::app::flush_results(octrace::app::run_guarded(argc, argv));
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  octrace::image::finish_preload();  // sanitizers report from exit handlers
  return code;
#else
  // The image library may still be loading on its own thread, and running the exit handlers of its
  // 258 libraries would wait for that; files are closed and results flushed.
  std::_Exit(code);
#endif
}
