#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "backend/app/command.h"
#include "backend/app/info_report.h"
#include "backend/app/options.h"
#include "backend/app/time_options.h"

namespace octrace::app {

namespace {

struct InfoOptions {
  SceneRequest scene;
  TimeOptions time;
  bool json = false;
};

constexpr const char* kHelp = R"(Examples:
  octrace info builtin:default
  octrace info scene.glb --json)";

util::Result<util::Exit> run_info(InfoOptions options) {
  options.scene.collect_info = true;
  set_time(options.time, options.scene);
  // Nothing here depends on pixels, and the image library takes longer to load than most scenes.
  options.scene.decode_images = false;
  options.scene.need_textures = false;
  util::Result<std::unique_ptr<SceneSession>> session = open_scene(options.scene);
  if (!session) return session.error();
  const octree::Statistics statistics = octree::statistics((*session)->octree);
  const std::string report = options.json ? info_json(*(*session)->info, statistics)
                                          : info_text(*(*session)->info, statistics);
  std::fwrite(report.data(), 1, report.size(), stdout);
  return util::Exit::ok;
}

}  // namespace

void declare_info(CLI::App& program, Run& chosen) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command =
      program.add_subcommand("info", "say what a scene contains and how its octree turns out");
  command->footer(kHelp);
  add_scene_options(*command, options->scene);
  add_time_options(*command, options->time);
  command->add_flag("--json", options->json, "print JSON, with the same content");
  add_verbosity_options(*command);
  command->callback([options, &chosen] { chosen = [options] { return run_info(*options); }; });
}

}  // namespace octrace::app
