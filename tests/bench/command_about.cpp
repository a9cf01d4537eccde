// octrace-bench about: with what this program was made, for the head of a report.
#include <fmt/format.h>

#include "tests/bench/commands.h"
#include "tests/bench/embree_peer.h"

namespace octrace::bench {

void add_about_command(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("about", "The compiler and the peers of this program, as JSON");
  command->callback([&exit_code] {
#ifdef __clang__
    const std::string compiler = "Clang " __clang_version__;
#else
    const std::string compiler = "GCC " __VERSION__;
#endif
    const nlohmann::json about = {{"compiler", compiler}, {"embree", EmbreePeer::version()}};
    fmt::print("{}\n", about.dump());
    exit_code = 0;
  });
}

}  // namespace octrace::bench
