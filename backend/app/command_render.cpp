#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <set>

#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/app/preload.h"
#include "backend/app/progress.h"
#include "backend/app/render_stats.h"
#include "backend/app/time_options.h"
#include "backend/batch/camera_choice.h"
#include "backend/batch/next_frame.h"
#include "backend/batch/output.h"
#include "backend/image/image.h"
#include "backend/render/device.h"
#include "backend/render/renderer.h"
#include "backend/scene/instances.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"
#include "backend/util/process.h"

namespace octrace::app {

namespace {

using batch::Metadata;
using batch::Output;

struct RenderOptions {
  bool stats_in_file() const { return !stats.empty() && stats != kStandardOutput; }

  SceneRequest scene;
  TimeOptions time;
  std::vector<std::string> outputs;
  std::optional<std::string> aovs;
  std::string camera, size = "1280x720", sky, stats;
  kernels::RenderParams params;
  std::uint32_t tile = 0;
  double depth_scale = 1000.0;
  std::string device = "auto";
  render::DeviceChoice device_choice;
  ProgressMode progress = ProgressMode::automatic;
};

constexpr const char* kHelp = R"(Files:
  NAME.exr        every AOV of --aov, 32-bit float and UINT, in one file
  NAME.png .tif   one AOV: beauty, unless --aov names exactly one
  NAME.jpg        the same, 8-bit AOVs only
  NAME.npz .npy   for NumPy: every AOV of --aov as an array of its own, or one AOV
  FILE:AOV        this AOV, whatever --aov says: -o depth.png:Z; an .exr takes a list, a.exr:Z,mask
PNG, TIFF and JPEG hold beauty and albedo in sRGB, normals from [-1, 1], masks, uv and barycentric
from [0, 1], ids as 16-bit numbers, depth and distance as 16-bit numbers: metres * --depth-scale, 65535
where nothing is hit or it does not fit.

Cameras: --camera takes a name or an index of the scene's cameras (octrace info lists them), or a
file: {"type": "perspective", "yfov": 0.7, "matrix": [16 numbers, camera to world, by columns]};
"orthographic" with xmag and ymag; "pinhole" with fx, fy, cx, cy in pixels; znear and zfar optional.

Examples:
  octrace render builtin:default -o picture.png
  octrace render scene.glb -o frame.exr --aov beauty,Z,N,mask --spp 64 --size 1920x1080
  octrace render scene.glb -o walk.exr --animation walk --frame 12 --fps 30 --aov Z,mask,motion
  octrace render scene.glb -o depth.png:Z -o mask.png:mask --camera 0 --stats stats.json)";

void declare_view(CLI::App& command, RenderOptions& options) {
  command
      .add_option("-o,--output", options.outputs,
                  "image to write, .exr .png .tif .jpg .npz or .npy; may be repeated")
      ->required()
      ->allow_extra_args(false)
      ->type_name("FILE[:AOV]");
  command
      .add_option(
          "--aov", options.aovs,
          fmt::format("planes to render, by comma, or all: {} [beauty]", render::aov_names()))
      ->type_name("LIST");
  command
      .add_option("--camera", options.camera,
                  "which camera [the scene's first, else one that frames the bounds]")
      ->check([](const std::string& name) {  // an unset variable of a shell
        return name.empty() ? std::string("a name, an index or a file is needed") : std::string();
      })
      ->type_name("NAME|INDEX|FILE.json");
  command.add_option("--size", options.size, "pixels [1280x720]")->type_name("WxH");
  command.add_option("--spp", options.params.spp, "samples a pixel, for beauty only [16]")
      ->type_name("N");
  command.add_option("--seed", options.params.seed, "of the samples [0]")->type_name("N");
  command
      .add_option("--sky", options.sky,
                  fmt::format("radiance of the sky, linear [{},{},{}]", options.params.sky.x,
                              options.params.sky.y, options.params.sky.z))
      ->type_name("R,G,B");
  add_choice<std::uint32_t>(command, "--background", options.params.transparent_background,
                            {{"sky", 0}, {"transparent", 1}},
                            "what beauty shows where nothing is hit [sky]");
  add_choice<std::uint32_t>(
      command, "--cull", options.params.cull, {{"spec", 1}, {"none", 0}},
      "back faces: spec culls them as doubleSided says; none shows all [spec]");
  add_choice<std::uint32_t>(command, "--alpha", options.params.alpha, {{"spec", 1}, {"ignore", 0}},
                            "spec follows alphaMode; ignore makes everything opaque [spec]");
  command
      .add_option("--depth-scale", options.depth_scale,
                  "units a metre of 16-bit depth; 1000: millimetres, up to 65.534 m [1000]")
      ->check(CLI::Range(1e-6, 1e9).description(""))
      ->type_name("S");
}

void declare_running(CLI::App& command, RenderOptions& options) {
  command
      .add_option("--device", options.device,
                  "auto, cpu, cuda or cuda:N; auto takes the GPU where there is one [auto]")
      ->type_name("DEVICE");
  command
      .add_option(
          "--tile", options.tile,
          "pixels a side of what a thread takes at once. Never changes the image [by the image]")
      ->check(CLI::Range(1, 4096).description(""))
      ->type_name("N");
  command
      .add_option(
          "--stats", options.stats,
          "write times, rays, octree figures and memory to this JSON file; -: to standard output")
      ->type_name("FILE.json");
  add_choice<ProgressMode>(
      command, "--progress", options.progress,
      {{"auto", ProgressMode::automatic},
       {"bar", ProgressMode::bar},
       {"json", ProgressMode::json},
       {"none", ProgressMode::none}},
      "on standard error; auto: a bar on a terminal, nothing when piped; json: "
      "a line each [auto]");
}

util::Result<kernels::Vec3> parse_sky(const std::string& text) {
  kernels::Vec3 sky;
  std::size_t begin = 0;
  for (int c = 0; c < 3; ++c) {
    const std::size_t comma = text.find(',', begin);
    const bool last = comma == std::string::npos;
    float value = 0.0f;
    const bool number = CLI::detail::lexical_cast(text.substr(begin, comma - begin), value);
    if (!number || last != (c == 2) || !std::isfinite(value) || value < 0.0f) {
      return usage_error(
          fmt::format("--sky: '{}' is not three numbers of 0 or more, such as 0.5,0.6,0.7", text));
    }
    sky[c] = value;
    begin = comma + 1;
  }
  return sky;
}

// What the arguments mean, with everything checked that can be checked before any work.
struct Plan {
  ImageSize size;
  std::vector<Output> outputs;
  render::AovSet aovs;
  std::optional<scene::Camera> camera_file;
};

// No file of this command may replace another one, nor the scene itself.
util::Result<void> check_apart(const RenderOptions& options, const std::vector<Output>& outputs) {
  std::error_code ignored;
  const auto resolved = [&](const std::string& path) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(path, ignored), ignored);
  };
  std::set<std::filesystem::path> taken = {resolved(options.scene.source)};
  if (!options.camera.empty()) taken.insert(resolved(options.camera));
  std::vector<std::string> written;
  for (const Output& output : outputs) written.push_back(output.path);
  if (options.stats_in_file()) written.push_back(options.stats);
  for (const std::string& path : written) {
    if (!taken.insert(resolved(path)).second) {
      return usage_error(fmt::format("{}: would replace another file of this command", path));
    }
  }
  return {};
}

util::Result<Plan> make_plan(RenderOptions& options) {
  Plan plan;
  const util::Limits& limits = options.scene.limits;
  util::Result<ImageSize> size = parse_size(options.size, limits);
  if (!size) return size.error();
  plan.size = *size;
  util::Result<std::vector<Output>> outputs =
      plan_outputs(options.outputs, options.aovs, plan.size);
  if (!outputs) return outputs.error();
  plan.outputs = std::move(*outputs);
  plan.aovs = batch::needed_aovs(plan.outputs);
  if (options.params.spp == 0) return usage_error("--spp: at least 1 is needed");
  if (options.params.spp > limits.max_spp) {
    return util::Error{
        util::Exit::limit, "",
        fmt::format("--spp {}: --max-spp allows {}", options.params.spp, limits.max_spp), "", ""};
  }
  if (!std::isfinite(options.depth_scale)) return usage_error("--depth-scale: must be finite");
  if (!options.sky.empty()) {
    util::Result<kernels::Vec3> sky = parse_sky(options.sky);
    if (!sky) return sky.error();
    options.params.sky = *sky;
  }
  util::Result<render::DeviceChoice> device = render::parse_device(options.device);
  if (!device) return device.error();
  options.device_choice = *device;
  if (options.camera.ends_with(".json")) {
    util::Result<scene::Camera> camera = scene::read_camera_file(options.camera);
    if (!camera) return camera.error();
    plan.camera_file = std::move(*camera);
  }
  for (const Output& output : plan.outputs) {
    util::Result<void> writable = batch::check_writable(output.path);
    if (!writable) return writable.error();
  }
  if (util::Result<void> apart = check_apart(options, plan.outputs); !apart) return apart.error();
  if (options.stats_in_file()) {
    util::Result<void> writable = batch::check_writable(options.stats);
    if (!writable) return writable.error();
  }
  return plan;
}

util::Result<render::TraceStats> trace(const RenderOptions& options, const SceneSession& session,
                                       const scene::Camera& camera, Progress& progress,
                                       render::Framebuffer& framebuffer) {
  const std::unique_ptr<render::Renderer> renderer =
      render::make_renderer(session.scene, session.octree, options.device_choice);
  render::Settings settings;
  settings.params = options.params;
  settings.threads = options.scene.build.threads;
  settings.tile = options.tile;
  settings.progress = [&](double share) { progress.update(share); };
  settings.cancel = &util::interrupt_flag();
  util::Result<scene::Moment> next = scene::Moment{};
  if (framebuffer.aovs().test(static_cast<std::size_t>(kernels::Aov::motion))) {
    next = session.at(options.time.next());
    if (!next) return next.error();
    settings.next = batch::next_frame(session.scene, camera, *next,
                                      {framebuffer.width(), framebuffer.height()});
  }
  return renderer->render(scene::make_ray_camera(camera, static_cast<int>(framebuffer.width()),
                                                 static_cast<int>(framebuffer.height())),
                          settings, framebuffer);
}

util::Result<void> write_outputs(const RenderOptions& options, const Plan& plan,
                                 const Metadata& metadata, const render::Framebuffer& framebuffer,
                                 Progress& progress) {
  if (batch::needs_image_library(plan.outputs)) {
    util::Result<void> threads = image::set_threads(options.scene.build.threads);
    if (!threads) return threads;
  }
  for (std::size_t i = 0; i < plan.outputs.size(); ++i) {
    progress.update(static_cast<double>(i) / static_cast<double>(plan.outputs.size()));
    if (const auto warning =
            batch::depth_warning(plan.outputs[i], framebuffer, options.depth_scale)) {
      util::log_warning(*warning);
    }
    util::Result<void> written =
        write_output(plan.outputs[i], framebuffer, options.depth_scale, metadata);
    if (!written) return written;
    util::log_verbose(fmt::format("wrote {}", plan.outputs[i].path));
  }
  return {};
}

util::Result<util::Exit> run_render(RenderOptions options) {
  RenderStats stats;
  util::Result<Plan> plan = make_plan(options);
  if (!plan) return plan.error();
  preload_libraries(batch::needs_image_library(plan->outputs));
  Progress progress(options.progress);

  progress.stage("load");
  options.scene.need_textures = batch::needs_textures(plan->aovs);
  set_time(options.time, options.scene);
  options.scene.moving =
      options.scene.time && plan->aovs.test(static_cast<std::size_t>(kernels::Aov::motion));
  util::Result<std::unique_ptr<SceneSession>> session = open_scene(options.scene);
  if (!session) return session.error();
  const double aspect =
      static_cast<double>(plan->size.width) / static_cast<double>(plan->size.height);
  util::Result<scene::Camera> camera =
      plan->camera_file ? util::Result<scene::Camera>(*plan->camera_file)
                        : batch::choose_camera(options.camera, (*session)->scene, aspect);
  if (!camera) return camera.error();

  const util::InterruptGuard interruptible;
  progress.stage("trace");
  const util::Timer trace_timer;
  render::Framebuffer framebuffer(plan->size.width, plan->size.height, plan->aovs);
  util::Result<render::TraceStats> traced =
      trace(options, **session, *camera, progress, framebuffer);
  if (!traced) return traced.error();
  stats.trace = *traced;
  stats.trace_ms = trace_timer.milliseconds();

  progress.stage("write");
  const util::Timer write_timer;
  util::Result<void> written = write_outputs(
      options, *plan, batch::view_metadata(options.scene.source, *camera), framebuffer, progress);
  if (!written) return written.error();
  stats.write_ms = write_timer.milliseconds();
  progress.finish();

  stats.width = plan->size.width;
  stats.height = plan->size.height;
  stats.camera = camera->name;
  stats.spp = options.params.spp;
  stats.builder = options.scene.build.builder;
  for (const Output& output : plan->outputs) stats.outputs.push_back(output.path);
  if (!options.stats.empty()) {
    util::Result<void> saved = write_stats(options.stats, stats, **session);
    if (!saved) return saved.error();
  }
  util::log_info(summary(stats, **session));
  return util::Exit::ok;
}

}  // namespace

void declare_render(CLI::App& program, Run& chosen) {
  auto options = std::make_shared<RenderOptions>();
  CLI::App* command = program.add_subcommand("render", "render one view of a scene to image files");
  command->footer(kHelp);
  add_scene_options(*command, options->scene);
  add_time_options(*command, options->time);
  declare_view(*command, *options);
  declare_running(*command, *options);
  add_verbosity_options(*command);
  command->callback([options, &chosen] { chosen = [options] { return run_render(*options); }; });
}

}  // namespace octrace::app
