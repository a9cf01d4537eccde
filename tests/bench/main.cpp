// octrace-bench: measures; octrace itself links none of it.
#include <fmt/format.h>

#include "backend/util/atomic_file.h"
#include "tests/bench/commands.h"

namespace octrace::bench {

int fail(const util::Error& error) {
  fmt::print(stderr, "octrace-bench: error: {}\n", error.to_string());
  return static_cast<int>(error.exit);
}

int write_json(const std::string& path, const nlohmann::json& rows) {
  if (path.empty()) return 0;
  const util::Result<void> written = util::write_file(path, rows.dump(2) + "\n");
  return written ? 0 : fail(written.error());
}

}  // namespace octrace::bench

int main(int argc, char** argv) {
  CLI::App app("Measures octrace: ray throughput and octree builds, beside Embree");
  app.require_subcommand(1);
  int exit_code = 0;
  octrace::bench::add_rays_command(app, exit_code);
  octrace::bench::add_build_command(app, exit_code);
  CLI11_PARSE(app, argc, argv);
  return exit_code;
}
