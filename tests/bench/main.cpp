// octrace-bench: measures; octrace itself links none of it.
#include <fmt/format.h>

#include <cstdio>

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

bool parse_size(const std::string& text, int* width, int* height) {
  constexpr int kMost = 32768;
  char rest = 0;
  const bool ok = std::sscanf(text.c_str(), "%dx%d%c", width, height, &rest) == 2 && *width >= 1 &&
                  *height >= 1 && *width <= kMost && *height <= kMost;
  if (!ok) fmt::print(stderr, "octrace-bench: error: --size needs WxH, at most {}\n", kMost);
  return ok;
}

}  // namespace octrace::bench

int main(int argc, char** argv) {
  CLI::App app("Measures octrace: rays, octree builds, growth and the seed paper's experiment");
  app.require_subcommand(1);
  int exit_code = 0;
  octrace::bench::add_rays_command(app, exit_code);
  octrace::bench::add_build_command(app, exit_code);
  octrace::bench::add_growth_command(app, exit_code);
  octrace::bench::add_paper_command(app, exit_code);
  octrace::bench::add_about_command(app, exit_code);
  CLI11_PARSE(app, argc, argv);
  return exit_code;
}
