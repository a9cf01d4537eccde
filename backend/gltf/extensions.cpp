#include "backend/gltf/extensions.h"

#include <algorithm>
#include <array>

#include "backend/gltf/document.h"

namespace octrace::gltf {
namespace {

constexpr std::array<std::string_view, 11> kHonoured{
    "EXT_mesh_gpu_instancing",    "EXT_meshopt_compression", "EXT_texture_webp",
    "KHR_draco_mesh_compression", "KHR_lights_punctual",     "KHR_materials_emissive_strength",
    "KHR_materials_unlit",        "KHR_materials_variants",  "KHR_mesh_quantization",
    "KHR_node_visibility",        "KHR_texture_transform",
};

// These change nothing but a material, and leave glTF's own material as the fallback.
constexpr std::array<std::string_view, 11> kApproximated{
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
};

bool contains(std::span<const std::string_view> list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

}  // namespace

Support extension_support(std::string_view name) {
  if (contains(kHonoured, name)) return Support::honoured;
  if (contains(kApproximated, name)) return Support::approximated;
  return Support::unknown;
}

std::span<const std::string_view> supported_extensions() { return kHonoured; }
std::span<const std::string_view> approximated_extensions() { return kApproximated; }

}  // namespace octrace::gltf
