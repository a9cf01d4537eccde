#include "backend/gltf/document.h"

namespace octrace::gltf {
namespace {

constexpr const char* kVariants = "KHR_materials_variants";

}  // namespace

std::vector<std::string> variant_names(const tinygltf::Model& model) {
  std::vector<std::string> names;
  const auto extension = model.extensions.find(kVariants);
  if (extension == model.extensions.end()) return names;
  const tinygltf::Value& variants = extension->second.Get("variants");
  for (std::size_t i = 0; i < variants.ArrayLen(); ++i) {
    names.push_back(variants.Get(static_cast<int>(i)).Get("name").Get<std::string>());
  }
  return names;
}

std::map<int, int> variant_materials(const tinygltf::Primitive& primitive) {
  std::map<int, int> materials;
  const auto extension = primitive.extensions.find(kVariants);
  if (extension == primitive.extensions.end()) return materials;
  const tinygltf::Value& mappings = extension->second.Get("mappings");
  for (std::size_t i = 0; i < mappings.ArrayLen(); ++i) {
    const tinygltf::Value& mapping = mappings.Get(static_cast<int>(i));
    const tinygltf::Value& variants = mapping.Get("variants");
    for (std::size_t k = 0; k < variants.ArrayLen(); ++k) {
      materials[variants.Get(static_cast<int>(k)).GetNumberAsInt()] =
          mapping.Get("material").GetNumberAsInt();
    }
  }
  return materials;
}

bool node_visible(const tinygltf::Node& node) {
  const auto extension = node.extensions.find("KHR_node_visibility");
  if (extension == node.extensions.end() || !extension->second.Has("visible")) return true;
  return extension->second.Get("visible").Get<bool>();
}

}  // namespace octrace::gltf
