#include "backend/app/reference_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <string_view>

#include "backend/gltf/document.h"

namespace octrace::app {

namespace {

// extensions_managed of io_scene_gltf2/io/imp/gltf2_io_gltf.py: another one that the file requires
// makes the importer give up.
constexpr std::array<std::string_view, 13> kImported{"KHR_materials_pbrSpecularGlossiness",
                                                     "KHR_lights_punctual",
                                                     "KHR_materials_unlit",
                                                     "KHR_texture_transform",
                                                     "KHR_materials_clearcoat",
                                                     "KHR_mesh_quantization",
                                                     "KHR_draco_mesh_compression",
                                                     "KHR_materials_variants",
                                                     "KHR_materials_emissive_strength",
                                                     "KHR_materials_transmission",
                                                     "KHR_materials_specular",
                                                     "KHR_materials_sheen",
                                                     "KHR_materials_ior"};

// Largest cosine between two axes that still counts as a right angle: rounded numbers in a file.
constexpr double kRightAngle = 1e-4;

bool shears(const std::vector<double>& matrix) {
  if (matrix.size() != 16) return false;
  glm::dvec3 axes[3];
  for (int c = 0; c < 3; ++c) {
    const auto at = [&](int r) { return matrix[static_cast<std::size_t>(4 * c + r)]; };
    axes[c] = {at(0), at(1), at(2)};
  }
  for (int c = 0; c < 3; ++c) {
    const glm::dvec3 &a = axes[c], &b = axes[(c + 1) % 3];
    const double lengths = glm::length(a) * glm::length(b);
    if (lengths > 0.0 && std::abs(glm::dot(a, b)) > kRightAngle * lengths) return true;
  }
  return false;
}

// The importer has nodes compute what a sampler of two different wraps does, and lets the image
// itself clamp: at a seam that repeats, the filter reads the border twice instead of its far side.
bool filters_across_a_seam(const scene::Scene& scene, const kernels::Material& material) {
  const std::uint32_t index = material.base_color_texture.texture;
  if (material.alpha_mode != kernels::AlphaMode::mask || index == kernels::kNone) return false;
  const kernels::Texture& texture = scene.textures[index];
  const bool repeats =
      texture.wrap_s == kernels::Wrap::repeat || texture.wrap_t == kernels::Wrap::repeat;
  return repeats && texture.wrap_s != texture.wrap_t && texture.filter == kernels::Filter::linear;
}

}  // namespace

util::Result<ReferenceLimits> blender_limits(const batch::SceneRequest& request,
                                             const scene::Scene& scene) {
  ReferenceLimits limits;
  const bool cut_by_colors = std::any_of(
      scene.geometries.begin(), scene.geometries.end(), [&](const kernels::Geometry& geometry) {
        return geometry.colors != kernels::kNone &&
               scene.materials[geometry.material].alpha_mode == kernels::AlphaMode::mask;
      });
  if (cut_by_colors) {
    limits.shown_otherwise.emplace_back(
        "Blender's importer keeps vertex colours in 8 bits, and here their alpha cuts out (MASK)");
  }
  const auto seams = [&](const kernels::Material& m) { return filters_across_a_seam(scene, m); };
  if (std::any_of(scene.materials.begin(), scene.materials.end(), seams)) {
    limits.shown_otherwise.emplace_back(
        "Blender's importer does not filter across the seams of a texture that wraps differently "
        "in "
        "its two directions, and here its alpha cuts out (MASK)");
  }
  // These reach Blender as octrace writes them.
  if (request.source.starts_with("builtin:") || scene.instancing) return limits;

  auto document = gltf::load(request.source, {request.limits, true});
  if (!document) return document.error();
  for (const std::string& extension : document->model.extensionsRequired) {
    if (std::find(kImported.begin(), kImported.end(), extension) == kImported.end()) {
      limits.refused.push_back(
          fmt::format("Blender 3.4's importer refuses files that require {}", extension));
    }
  }
  if (!request.variant.empty()) {
    limits.shown_otherwise.emplace_back(
        "Blender's importer gives every mesh its own materials, not those of --variant");
  }
  const auto visible = [](const tinygltf::Node& node) { return gltf::node_visible(node); };
  if (!std::all_of(document->model.nodes.begin(), document->model.nodes.end(), visible)) {
    limits.shown_otherwise.emplace_back(
        "Blender's importer shows the nodes that KHR_node_visibility hides");
  }
  for (std::size_t i = 0; i < document->model.nodes.size(); ++i) {
    if (!shears(document->model.nodes[i].matrix)) continue;
    limits.shown_otherwise.push_back(fmt::format(
        "the matrix of node {} shears, and Blender's objects have a translation, a rotation and a "
        "scale only",
        i));
    break;
  }
  return limits;
}

}  // namespace octrace::app
