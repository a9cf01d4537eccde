#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>

#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/app/time_options.h"
#include "backend/batch/camera_choice.h"
#include "backend/scene/builtin.h"
#include "backend/scene/instances.h"
#include "backend/util/log.h"
#include "exporters/blender/blender.h"
#include "exporters/gltf/gltf.h"
#include "exporters/povray/povray.h"
#include "exporters/text.h"

namespace octrace::app {

namespace {

enum class Target { povray, blender, gltf };

struct ExportOptions {
  SceneRequest scene;
  TimeOptions time;
  Target target = Target::gltf;
  std::string folder;
  std::string camera;
  std::string size = "640x480";
  exporters::PovrayOptions povray;
};

// A camera and what its files are called.
struct NamedCamera {
  scene::Camera camera;
  std::string stem;
};

constexpr const char* kAllCameras = "ALL";

constexpr const char* kHelp = R"(Examples:
  octrace export scene.glb --to povray -o out                  depth, mask and ids for POV-Ray
  octrace export scene.glb --to povray --mode scene -o out     a picture with materials and lights
  octrace export scene.glb --to blender --camera ALL -o out    one script for all of its cameras
  octrace export builtin:default --to gltf -o out              every transform and pose baked in
  octrace export scene.glb --to gltf --frame 12 -o out         the pose of an animation's frame 12

The files' paths and the command that renders them are printed. What the other program cannot show
as octrace does is said in warnings.)";

std::string file_stem(const std::string& source) {
  const std::string name = source.starts_with(scene::kBuiltinPrefix)
                               ? source.substr(scene::kBuiltinPrefix.size())
                               : exporters::path_parts(source).stem;
  const std::string stem = exporters::path_parts(name).safe_stem;
  return stem.empty() || stem.front() == '.' || stem.front() == '-' ? fmt::format("scene{}", stem)
                                                                    : stem;
}

util::Result<std::vector<NamedCamera>> cameras_of(const ExportOptions& options,
                                                  const scene::Scene& scene, double aspect) {
  const std::string stem = file_stem(options.scene.source);
  std::vector<NamedCamera> cameras;
  if (options.camera == kAllCameras && !scene.cameras.empty()) {
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
      cameras.push_back({scene.cameras[i], fmt::format("{}_{}", stem, i)});
    }
    return cameras;
  }
  const auto camera =
      batch::choose_camera(options.camera == kAllCameras ? "" : options.camera, scene, aspect);
  if (!camera) return camera.error();
  cameras.push_back({*camera, stem});
  return cameras;
}

void print_command(const std::string& folder, const std::string& program,
                   const std::vector<std::string>& arguments) {
  fmt::print("  cd '{}' && {} {}\n", folder, program, fmt::join(arguments, " "));
}

void warn(const std::vector<std::string>& notes, const char* program) {
  for (const std::string& note : notes) util::log_warning(fmt::format("{}: {}", program, note));
}

util::Result<void> export_povray(const ExportOptions& options, const scene::Scene& scene,
                                 const std::vector<NamedCamera>& cameras) {
  for (const NamedCamera& named : cameras) {
    const std::string path = fmt::format("{}/{}.pov", options.folder, named.stem);
    const auto file = exporters::write_povray(scene, named.camera, options.povray, path);
    if (!file) return file.error();
    warn(file->notes, "POV-Ray");
    for (const std::string& written : file->written) fmt::print("{}\n", written);
    print_command(options.folder, "povray", file->arguments);
  }
  return {};
}

util::Result<std::string> export_gltf(const ExportOptions& options, const scene::Scene& scene) {
  const std::string path =
      fmt::format("{}/{}.glb", options.folder, file_stem(options.scene.source));
  std::error_code error;
  if (std::filesystem::equivalent(path, options.scene.source, error)) {
    return usage_error(
        fmt::format("-o {}: {} would be written over the scene itself", options.folder, path));
  }
  const auto file = exporters::write_gltf(scene, path);
  if (!file) return file.error();
  warn(file->notes, "glTF");
  fmt::print("{}\n", path);
  return path;
}

// Whether Blender is given the flattened scene. At a time it must be: its importer keeps the keys
// of an animation but not what glTF has between them. Nor does it know instances.
bool is_baked(const ExportOptions& options, bool has_instances) {
  return options.scene.source.starts_with(scene::kBuiltinPrefix) || options.time.time() ||
         has_instances;
}

util::Result<void> export_blender(const ExportOptions& options, const scene::Scene& scene,
                                  bool has_instances, const std::vector<NamedCamera>& cameras) {
  exporters::BlenderScene job;
  job.cull = options.povray.cull;
  job.alpha = options.povray.alpha;
  if (is_baked(options, has_instances)) {
    // There is no original to import, or not at this time: Blender reads what octrace writes.
    const auto path = export_gltf(options, scene);
    if (!path) return path.error();
    job.file = exporters::path_parts(*path).name;
  } else {
    job.gltf_scene = options.scene.scene;
    job.file = std::filesystem::absolute(options.scene.source).lexically_normal().string();
  }
  for (const NamedCamera& named : cameras) {
    exporters::BlenderView view;
    view.camera = named.camera;
    view.width = options.povray.width;
    view.height = options.povray.height;
    view.output = named.stem + ".exr";
    exporters::blender_clip(scene.bounds, view);
    job.views.push_back(view);
  }
  const std::string name = file_stem(options.scene.source) + ".py";
  const std::string path = fmt::format("{}/{}", options.folder, name);
  if (auto written = exporters::write_blender({job}, path); !written) return written;
  fmt::print("{}\n", path);
  print_command(options.folder, "blender", exporters::blender_arguments(name));
  return {};
}

util::Result<util::Exit> run_export(ExportOptions options) {
  const auto size = parse_size(options.size, options.scene.limits);
  if (!size) return size.error();
  options.povray.width = static_cast<int>(size->width);
  options.povray.height = static_cast<int>(size->height);
  // Geometry alone needs no colour textures.
  options.scene.need_textures =
      options.target == Target::gltf ||
      (options.target == Target::povray && options.povray.mode == exporters::PovrayMode::scene) ||
      options.target == Target::blender;  // for what it cannot import itself
  set_time(options.time, options.scene);
  const auto session = open_scene(options.scene);
  if (!session) return session.error();
  const bool has_instances = (*session)->scene.instancing != nullptr;
  if (has_instances) {
    // The formats know no instances, or not of a kind that every reader follows.
    auto baked = scene::bake_instances((*session)->scene, options.scene.limits);
    if (!baked) return baked.error();
    (*session)->scene = std::move(*baked);
  }
  const scene::Scene& scene = (*session)->scene;
  const auto cameras = cameras_of(options, scene, static_cast<double>(size->width) / size->height);
  if (!cameras) return cameras.error();

  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error) {
    return util::Error{util::Exit::io, "IO_ERROR",
                       fmt::format("the folder cannot be made: {}", error.message()),
                       options.folder, ""};
  }
  util::Result<void> done;
  if (options.target == Target::povray) {
    done = export_povray(options, scene, *cameras);
  } else if (options.target == Target::blender) {
    done = export_blender(options, scene, has_instances, *cameras);
  } else if (const auto path = export_gltf(options, scene); !path) {
    done = path.error();
  }
  if (!done) return done.error();
  return util::Exit::ok;
}

}  // namespace

void declare_export(CLI::App& program, Run& chosen) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command = program.add_subcommand(
      "export", "write a scene for POV-Ray or Blender, or flattened as one .glb");
  command->footer(kHelp);
  add_scene_options(*command, options->scene);
  add_time_options(*command, options->time);
  command->add_option("--to", options->target, "the program or format to write for")
      ->required()
      ->transform(CLI::CheckedTransformer(std::map<std::string, Target>{
          {"povray", Target::povray}, {"blender", Target::blender}, {"gltf", Target::gltf}}))
      ->type_name("povray|blender|gltf");
  command->add_option("-o,--output", options->folder, "folder to write to; made where missing")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--mode", options->povray.mode,
                   "povray: depth, mask and object ids as exact numbers, or the scene as a picture "
                   "[depth]")
      ->transform(CLI::CheckedTransformer(std::map<std::string, exporters::PovrayMode>{
          {"depth", exporters::PovrayMode::depth}, {"scene", exporters::PovrayMode::scene}}))
      ->type_name("depth|scene");
  command
      ->add_option("--camera", options->camera,
                   "a camera's name or index, a FILE.json, or ALL [the first; framed if none]")
      ->type_name("NAME|INDEX|FILE.json|ALL");
  command->add_option("--size", options->size, "of the image, in pixels [640x480]")
      ->type_name("WxH");
  command
      ->add_option("--cull", options->povray.cull,
                   "spec: no back faces but of double-sided materials; none: all faces [spec]")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, bool>{{"spec", true}, {"none", false}}))
      ->type_name("spec|none");
  command
      ->add_option("--alpha", options->povray.alpha,
                   "spec: alpha modes as glTF has them; ignore: everything is opaque [spec]")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, bool>{{"spec", true}, {"ignore", false}}))
      ->type_name("spec|ignore");
  command
      ->add_option("--antialias", options->povray.antialias,
                   "povray --mode scene: subdivisions of a pixel [0]")
      ->check(CLI::Range(0, 9))
      ->type_name("N");
  add_verbosity_options(*command);
  command->callback([options, &chosen] { chosen = [options] { return run_export(*options); }; });
}

}  // namespace octrace::app
