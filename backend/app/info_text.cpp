#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <iterator>

#include "backend/app/info_report.h"

namespace octrace::app {

namespace {

class Text {
 public:
  template <class... Arguments>
  void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    text_ += '\n';
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

// Names come from a file: control characters would let it write to the terminal.
std::string quoted(const std::string& name) {
  std::string out = "\"";
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte < 0x20 || byte == 0x7f ? fmt::format("\\x{:02x}", byte) : std::string(1, c);
  }
  return out + "\"";
}

std::string metres(double value) {
  return std::isfinite(value) ? fmt::format("{:g}", value) : "none";
}

void file_part(const scene::SceneInfo& info, Text& text) {
  text.line("{}", info.source);
  if (!info.version.empty())
    text.line("  glTF {}, made by {}", info.version, quoted(info.generator));
  if (!info.copyright.empty()) text.line("  copyright {}", quoted(info.copyright));
  for (std::size_t i = 0; i < info.scenes.size(); ++i) {
    const auto& scene = info.scenes[i];
    text.line("scene {} {}: {} root nodes, {} nodes{}", i, quoted(scene.name), scene.roots,
              scene.nodes, static_cast<int>(i) == info.default_scene ? " (default)" : "");
  }
}

void camera_part(const scene::SceneInfo& info, Text& text) {
  for (std::size_t i = 0; i < info.cameras.size(); ++i) {
    const auto& camera = info.cameras[i];
    const std::string lens = camera.type == "perspective"
                                 ? fmt::format("yfov {:g} rad", camera.yfov)
                             : camera.type == "orthographic" ? fmt::format("ymag {:g}", camera.ymag)
                                                             : std::string("pixels");
    text.line("camera {} {}: {}, {}, znear {:g}, zfar {}, at ({:g}, {:g}, {:g})", i,
              quoted(camera.name), camera.type, lens, camera.znear, metres(camera.zfar),
              camera.eye[0], camera.eye[1], camera.eye[2]);
  }
}

void content_part(const scene::SceneInfo& info, Text& text) {
  for (std::size_t i = 0; i < info.meshes.size(); ++i) {
    const auto& mesh = info.meshes[i];
    text.line("mesh {} {}: {} triangles, {} vertices, {} primitives, {} instances{}{}; {}", i,
              quoted(mesh.name), mesh.triangles, mesh.vertices, mesh.primitives, mesh.instances,
              mesh.morph_targets > 0 ? fmt::format(", {} morph targets", mesh.morph_targets) : "",
              mesh.points_and_lines > 0
                  ? fmt::format(", {} of points or lines left out", mesh.points_and_lines)
                  : "",
              fmt::join(mesh.attributes, " "));
  }
  for (std::size_t i = 0; i < info.materials.size(); ++i) {
    const auto& material = info.materials[i];
    text.line("material {} {}: {}{}{}, {} textures{}{}", i, quoted(material.name),
              material.alpha_mode, material.double_sided ? ", double-sided" : "",
              material.unlit ? ", unlit" : "", material.textures,
              material.extensions.empty() ? "" : "; ", fmt::join(material.extensions, " "));
  }
  for (std::size_t i = 0; i < info.lights.size(); ++i) {
    const auto& light = info.lights[i];
    text.line("light {} {}: {}, intensity {:g}, range {}", i, quoted(light.name), light.type,
              light.intensity, metres(light.range));
  }
  for (std::size_t i = 0; i < info.animations.size(); ++i) {
    const auto& animation = info.animations[i];
    text.line("animation {} {}: {:g} s to {:g} s, {} channels of {} nodes ({})", i,
              quoted(animation.name), animation.start, animation.end, animation.channels,
              animation.nodes, fmt::join(animation.paths, ", "));
  }
  for (std::size_t i = 0; i < info.skins.size(); ++i) {
    text.line("skin {} {}: {} joints", i, quoted(info.skins[i].name), info.skins[i].joints);
  }
  for (std::size_t i = 0; i < info.images.size(); ++i) {
    const auto& image = info.images[i];
    text.line("image {} {}: {}, {} bytes", i, quoted(image.name), image.mime, image.bytes);
  }
  for (std::size_t i = 0; i < info.variants.size(); ++i) {
    text.line("variant {} {}: changes the material of {} primitives", i,
              quoted(info.variants[i].name), info.variants[i].primitives);
  }
  if (info.hidden_nodes > 0) text.line("hidden: {} nodes", info.hidden_nodes);
  for (const auto& extension : info.extensions) {
    text.line("extension {}: {}{}", extension.name,
              extension.honoured ? "honoured" : "not honoured",
              extension.required ? ", required" : "");
  }
}

void flat_part(const scene::SceneInfo& info, const octree::Statistics& octree, Text& text) {
  text.line("flattened: {} triangles, {} vertices, {} objects, {} lights, {} textures, {} bytes",
            info.triangles, info.vertices, info.objects, info.lights_placed, info.textures,
            info.bytes);
  if (info.instances > 0) {
    text.line("instances: {} of {} meshes; {} triangles kept, {} shown", info.instances,
              info.instanced_meshes, info.instanced_triangles_kept, info.instanced_triangles_shown);
  }
  if (info.bounds.empty) {
    text.line("bounds: empty");
  } else {
    const auto& low = info.bounds.lower;
    const auto& high = info.bounds.upper;
    text.line("bounds: ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g}) m", low.x, low.y, low.z, high.x,
              high.y, high.z);
  }
  text.line(
      "octree: {} nodes, {} leaves, depth {}, {} bytes, {:.2f} children a node, {:.2f} "
      "triangles a leaf, SAH cost {:.2f}",
      octree.nodes, octree.leaves, octree.depth, octree.bytes, octree.children_per_node,
      octree.triangles_per_leaf, octree.sah_cost);
}

}  // namespace

std::string info_text(const scene::SceneInfo& info, const octree::Statistics& octree) {
  Text text;
  file_part(info, text);
  camera_part(info, text);
  content_part(info, text);
  flat_part(info, octree, text);
  return text.take();
}

}  // namespace octrace::app
