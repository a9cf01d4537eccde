#include "backend/app/options.h"

#include <fmt/format.h>

#include <charconv>

#include "backend/util/log.h"

namespace octrace::app {

namespace {

constexpr const char* kTuning = "Octree";
constexpr const char* kLimits =
    "Limits (exceeding one is exit code 6; BYTES takes k, M, G as powers of 1024)";

// Digits only, the whole text.
std::optional<std::uint32_t> parse_count(std::string_view text) {
  std::uint32_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end || text.empty()) return std::nullopt;
  return value;
}

void add_limit(CLI::App& command, const std::string& name, std::uint64_t& value,
               const std::string& help, bool bytes) {
  CLI::Option* option =
      command.add_option(name, value, help)->group(kLimits)->capture_default_str();
  option->type_name("N");
  if (bytes) option->transform(CLI::AsSizeValue(false).description(""))->type_name("BYTES");
}

}  // namespace

void add_scene_options(CLI::App& command, SceneRequest& request) {
  command
      .add_option(
          "SCENE", request.source,
          "a .gltf or .glb file, or builtin:default, builtin:paper, builtin:terrain[:QUADS], "
          "builtin:soup[:TRIANGLES]")
      ->required()
      ->type_name("");
  command.add_option("--scene", request.scene, "index of the glTF scene [the file's default]")
      ->check(CLI::Range(0, 1 << 24).description(""))
      ->type_name("N");
  command
      .add_option("--variant", request.variant,
                  "name or index of a variant of the materials [the file's own materials]")
      ->check([](const std::string& name) {  // an unset variable of a shell
        return name.empty() ? std::string("a name or an index is needed") : std::string();
      })
      ->type_name("NAME|INDEX");
  add_choice<bool>(
      command, "--missing-images", request.missing_images_warn, {{"error", false}, {"warn", true}},
      "a missing or broken texture: error, or warn and use the material's factor alone "
      "[error]");
  command
      .add_option("--threads", request.build.threads,
                  "threads to use; 0: all cores. Never changes the result [0]")
      ->check(CLI::Range(0, 4096).description(""))
      ->type_name("N");
  add_tuning_options(command, request.build, request.verify);
  add_limit_options(command, request.limits);
}

void add_tuning_options(CLI::App& command, octree::BuildOptions& build, bool& verify) {
  add_choice<octree::Builder>(
      command, "--builder", build.builder,
      {{"median", octree::Builder::median},
       {"sah", octree::Builder::sah},
       {"quality", octree::Builder::quality}},
      "sah: surface-area heuristic; quality: slower, for fewer tests a ray; median: the paper's. "
      "Never changes the image [sah]")
      ->group(kTuning);
  command
      .add_option("--leaf", build.leaf,
                  "most vertices (median) or triangles (others) in a leaf [8, 3]")
      ->check(CLI::Range(1, 1 << 20).description(""))
      ->type_name("N")
      ->group(kTuning);
  command
      .add_flag("--verify", verify,
                "check every invariant of the built octree; a violation is exit code 7")
      ->group(kTuning);
}

void add_limit_options(CLI::App& command, util::Limits& limits) {
  add_limit(command, "--max-file-bytes", limits.max_file_bytes, "any one file read", true);
  add_limit(command, "--max-json-bytes", limits.max_json_bytes, "a glTF's JSON", true);
  add_limit(command, "--max-json-depth", limits.max_json_depth, "nesting of JSON values", false);
  add_limit(command, "--max-scene-bytes", limits.max_scene_bytes, "flattened scene and octree",
            true);
  add_limit(command, "--max-triangles", limits.max_triangles,
            "kept: a mesh with instances counts once", false);
  add_limit(command, "--max-nodes", limits.max_nodes, "glTF nodes in a file", false);
  add_limit(command, "--max-instances", limits.max_instances, "of EXT_mesh_gpu_instancing", false);
  add_limit(command, "--max-texture-pixels", limits.max_texture_pixels, "one texture", false);
  add_limit(command, "--max-image-pixels", limits.max_image_pixels, "the rendered image", false);
  add_limit(command, "--max-spp", limits.max_spp, "samples a pixel", false);
}

void add_views_limit(CLI::App& command, util::Limits& limits) {
  add_limit(command, "--max-views", limits.max_views, "views of the job, in all its shards", false);
}

void add_verbosity_options(CLI::App& command) {
  CLI::Option* quiet = command.add_flag_callback(
      "--quiet", [] { util::set_verbosity(util::Verbosity::quiet); }, "errors only");
  command
      .add_flag_callback(
          "--verbose", [] { util::set_verbosity(util::Verbosity::verbose); },
          "say what is being done")
      ->excludes(quiet);
}

util::Result<ImageSize> parse_size(const std::string& text, const util::Limits& limits) {
  const std::size_t cross = text.find('x');
  const auto width = parse_count(std::string_view(text).substr(0, cross));
  const auto height = cross == std::string::npos
                          ? std::nullopt
                          : parse_count(std::string_view(text).substr(cross + 1));
  if (!width || !height || *width == 0 || *height == 0) {
    return usage_error(fmt::format("--size: '{}' is not WxH in pixels, such as 1280x720", text));
  }
  const std::uint64_t pixels = static_cast<std::uint64_t>(*width) * *height;
  if (pixels > limits.max_image_pixels || *width > 0x7fffffffu || *height > 0x7fffffffu) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("--size {}: {} pixels, --max-image-pixels allows {}", text,
                                   pixels, limits.max_image_pixels),
                       "", ""};
  }
  return ImageSize{*width, *height};
}

}  // namespace octrace::app
