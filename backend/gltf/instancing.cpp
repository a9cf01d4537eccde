#include "backend/gltf/instancing.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "backend/gltf/accessor.h"

namespace octrace::gltf {

namespace {

// Bytes and shorts do not hold unit quaternions exactly, and exporters round floats; what is left
// is taken as a rotation. Further off it would be one that also scales.
constexpr double kUnitTolerance = 3e-2;

const tinygltf::Value* attributes_of(const tinygltf::Node& node) {
  const auto extension = node.extensions.find(kInstancingExtension);
  if (extension == node.extensions.end() || !extension->second.IsObject()) return nullptr;
  const tinygltf::Value& attributes = extension->second.Get("attributes");
  return attributes.IsObject() ? &attributes : nullptr;
}

std::string place_of(std::size_t node, const std::string& attribute) {
  return fmt::format("/nodes/{}/extensions/{}/attributes/{}", node, kInstancingExtension,
                     pointer_key(attribute));
}

bool fits(const tinygltf::Accessor& accessor, const std::string& attribute) {
  const bool is_float = accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
  if (attribute == "TRANSLATION" || attribute == "SCALE") {
    return accessor.type == TINYGLTF_TYPE_VEC3 && is_float;
  }
  if (attribute == "ROTATION") {
    const bool is_normalised =
        accessor.normalized && (accessor.componentType == TINYGLTF_COMPONENT_TYPE_BYTE ||
                                accessor.componentType == TINYGLTF_COMPONENT_TYPE_SHORT);
    return accessor.type == TINYGLTF_TYPE_VEC4 && (is_float || is_normalised);
  }
  return true;
}

}  // namespace

std::optional<InstanceAccessors> instance_accessors(const tinygltf::Node& node,
                                                    const tinygltf::Model& model) {
  const tinygltf::Value* attributes = attributes_of(node);
  if (attributes == nullptr || node.mesh < 0) return std::nullopt;
  InstanceAccessors found;
  for (const std::string& name : attributes->Keys()) {
    const int accessor = attributes->Get(name).GetNumberAsInt();
    found.count = model.accessors[static_cast<std::size_t>(accessor)].count;
    if (name == "TRANSLATION") found.translation = accessor;
    if (name == "ROTATION") found.rotation = accessor;
    if (name == "SCALE") found.scale = accessor;
  }
  return found;
}

void check_instancing(const JsonRef& node, const Sizes& sizes) {
  const JsonRef extensions = node.member("extensions");
  const JsonRef extension = extensions.member(kInstancingExtension);
  if (!extension) return;
  const JsonRef object = extension.as_object();
  const JsonRef attributes = object.required("attributes");
  if (!attributes || !attributes.as_object()) return;
  if (attributes.json().empty()) {
    attributes.invalid("EMPTY_ENTITY", "names no accessor, so there is no number of instances");
  }
  attributes.each_member([&](std::string_view, const JsonRef& accessor) {
    (void)accessor.as_index(sizes.accessors, "accessor");
  });
}

void check_instancing_links(const tinygltf::Model& model, const util::Limits& limits,
                            Issues& issues) {
  for (std::size_t n = 0; n < model.nodes.size() && !issues.failed(); ++n) {
    const tinygltf::Node& node = model.nodes[n];
    const tinygltf::Value* attributes = attributes_of(node);
    if (attributes == nullptr) continue;
    const auto accessors = instance_accessors(node, model);
    for (const std::string& name : attributes->Keys()) {
      const int index = attributes->Get(name).GetNumberAsInt();
      const tinygltf::Accessor& accessor = model.accessors[static_cast<std::size_t>(index)];
      if (!fits(accessor, name)) {
        issues.invalid(
            "INSTANCE_ACCESSOR_INVALID_FORMAT", place_of(n, name),
            fmt::format("accessor {} is {}, which {} cannot be", index,
                        format_name(accessor.type, accessor.componentType, accessor.normalized),
                        name));
      }
      if (accessors && accessor.count != accessors->count) {
        issues.invalid("INSTANCE_UNEQUAL_ACCESSOR_COUNT", place_of(n, name),
                       fmt::format("has {} elements, another attribute has {}", accessor.count,
                                   accessors->count));
      }
      // Before any accessor is decoded: one without a buffer view costs a file nothing.
      if (accessor.count > limits.max_instances) {
        issues.fail(util::Exit::limit, "", place_of(n, name),
                    fmt::format("has {} instances, --max-instances allows {}", accessor.count,
                                limits.max_instances));
      }
    }
    if (accessors && node.skin >= 0) {
      issues.fail(
          util::Exit::unsupported, "", fmt::format("/nodes/{}/skin", n),
          fmt::format("{} says nothing of skinned meshes; instances of one are not supported",
                      kInstancingExtension));
    }
  }
}

void check_instance_rotations(const tinygltf::Model& model, Issues& issues) {
  std::vector<bool> seen(model.accessors.size());
  std::vector<float> values;
  for (std::size_t n = 0; n < model.nodes.size() && !issues.failed(); ++n) {
    const auto accessors = instance_accessors(model.nodes[n], model);
    if (!accessors || accessors->rotation < 0) continue;
    const auto index = static_cast<std::size_t>(accessors->rotation);
    if (seen[index]) continue;
    seen[index] = true;
    read_floats(model, accessors->rotation, values);
    for (std::size_t i = 0; i + 4 <= values.size(); i += 4) {
      double squared = 0.0;
      for (std::size_t k = i; k < i + 4; ++k) squared += double{values[k]} * values[k];
      if (std::abs(std::sqrt(squared) - 1.0) <= kUnitTolerance) continue;
      issues.invalid("ROTATION_NON_UNIT", place_of(n, "ROTATION"),
                     fmt::format("instance {} needs length 1, has {}", i / 4, std::sqrt(squared)));
      break;
    }
  }
}

}  // namespace octrace::gltf
