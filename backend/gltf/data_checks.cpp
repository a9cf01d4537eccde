#include "backend/gltf/data_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "backend/gltf/accessor.h"

namespace octrace::gltf {
namespace {

// Many primitives may share one accessor, so each is looked through once.
class LargestValues {
 public:
  explicit LargestValues(const tinygltf::Model& model)
      : model_(model), known_(model.accessors.size()) {}
  std::uint32_t of(int accessor) {
    auto& known = known_[static_cast<std::size_t>(accessor)];
    if (!known) known = largest_uint(model_, accessor);
    return *known;
  }

 private:
  const tinygltf::Model& model_;
  std::vector<std::optional<std::uint32_t>> known_;
};

void check_sparse_indices(const tinygltf::Model& model, std::size_t index, Issues& issues) {
  const auto& accessor = model.accessors[index];
  if (!accessor.sparse.isSparse) return;
  std::vector<std::uint32_t> places;
  read_sparse_indices(model, static_cast<int>(index), places);
  const std::string pointer = fmt::format("/accessors/{}/sparse", index);
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i] >= accessor.count) {
      issues.invalid("ACCESSOR_SPARSE_INDEX_OOB", pointer,
                     fmt::format("sparse index {} is {}, the accessor has {} elements", i,
                                 places[i], accessor.count));
      return;
    }
    if (i > 0 && places[i] <= places[i - 1]) {
      issues.invalid("ACCESSOR_SPARSE_INDICES_NON_INCREASING", pointer,
                     fmt::format("sparse index {} is {} after {}", i, places[i], places[i - 1]));
      return;
    }
  }
}

void check_floats(const tinygltf::Model& model, std::size_t index, Issues& issues) {
  if (model.accessors[index].componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) return;
  if (const auto element = first_not_finite(model, static_cast<int>(index))) {
    issues.invalid("ACCESSOR_INVALID_FLOAT", fmt::format("/accessors/{}", index),
                   fmt::format("element {} is not a finite number", *element));
  }
}

void check_indices(const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                   const std::string& pointer, LargestValues& largest, Issues& issues) {
  if (primitive.indices < 0) return;
  const auto& indices = model.accessors[static_cast<std::size_t>(primitive.indices)];
  const auto& attribute = primitive.attributes.begin()->second;  // all have the same count
  const std::size_t vertices = model.accessors[static_cast<std::size_t>(attribute)].count;
  const std::uint32_t value = largest.of(primitive.indices);
  const std::uint32_t restart =
      indices.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 0xff
      : indices.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 0xffff
                                                                        : 0xffffffff;
  if (value == restart) {
    issues.invalid("ACCESSOR_INDEX_PRIMITIVE_RESTART", pointer + "/indices",
                   fmt::format("{} would restart the primitive, which glTF does not allow", value));
  } else if (value >= vertices) {
    issues.invalid("ACCESSOR_INDEX_OOB", pointer + "/indices",
                   fmt::format("index {} needs {} vertices, there are {}", value,
                               std::uint64_t{value} + 1, vertices));
  }
}

struct LargestJoint {
  std::uint32_t value = 0;
  std::string pointer;  // empty: the mesh has no joints
};

LargestJoint largest_joint(const tinygltf::Model& model, std::size_t mesh, LargestValues& largest) {
  LargestJoint found;
  const auto& primitives = model.meshes[mesh].primitives;
  for (std::size_t p = 0; p < primitives.size(); ++p) {
    for (const auto& [name, accessor] : primitives[p].attributes) {
      if (!name.starts_with("JOINTS_")) continue;
      const std::uint32_t value = largest.of(accessor);
      if (!found.pointer.empty() && value <= found.value) continue;
      found = {value, fmt::format("/meshes/{}/primitives/{}/attributes/{}", mesh, p, name)};
    }
  }
  return found;
}

// Many nodes may share a mesh of many primitives, so each mesh is looked through once.
void check_joints(const tinygltf::Model& model, LargestValues& largest, Issues& issues) {
  std::vector<std::optional<LargestJoint>> known(model.meshes.size());
  for (const auto& node : model.nodes) {
    if (node.skin < 0) continue;
    const auto mesh = static_cast<std::size_t>(node.mesh);
    if (!known[mesh]) known[mesh] = largest_joint(model, mesh, largest);
    const LargestJoint& joint = *known[mesh];
    const std::size_t joints = model.skins[static_cast<std::size_t>(node.skin)].joints.size();
    if (joint.pointer.empty() || joint.value < joints) continue;
    issues.invalid("ACCESSOR_JOINTS_INDEX_OOB", joint.pointer,
                   fmt::format("joint {} needs {} joints, skin {} has {}", joint.value,
                               std::uint64_t{joint.value} + 1, node.skin, joints));
    return;
  }
}

void check_times(const tinygltf::Model& model, Issues& issues) {
  std::vector<bool> seen(model.accessors.size());
  std::vector<float> times;
  for (std::size_t a = 0; a < model.animations.size(); ++a) {
    const auto& samplers = model.animations[a].samplers;
    for (std::size_t s = 0; s < samplers.size(); ++s) {
      const auto& sampler = samplers[s];
      const auto index = static_cast<std::size_t>(sampler.input);
      if (seen[index]) continue;
      seen[index] = true;
      const std::string pointer = fmt::format("/animations/{}/samplers/{}/input", a, s);
      // Without a buffer view nearly all times are zero, and only the first one may be.
      if (model.accessors[index].bufferView < 0 && model.accessors[index].count > 1 &&
          !model.accessors[index].sparse.isSparse) {
        issues.invalid("ACCESSOR_ANIMATION_INPUT_NON_INCREASING", pointer, "all times are 0");
        return;
      }
      read_floats(model, sampler.input, times);
      for (std::size_t i = 0; i < times.size(); ++i) {
        if (times[i] < 0) {
          issues.invalid("ACCESSOR_ANIMATION_INPUT_NEGATIVE", pointer,
                         fmt::format("time {} is {}", i, times[i]));
          return;
        }
        if (i > 0 && times[i] <= times[i - 1]) {
          issues.invalid("ACCESSOR_ANIMATION_INPUT_NON_INCREASING", pointer,
                         fmt::format("time {} is {} after {}", i, times[i], times[i - 1]));
          return;
        }
      }
    }
  }
}

// The fourth row of an inverse bind matrix is 0 0 0 1; exporters' rounding stays within this.
constexpr float kAffineTolerance = 1e-3f;

void check_bind_matrices(const tinygltf::Model& model, Issues& issues) {
  std::vector<bool> seen(model.accessors.size());
  std::vector<float> values;
  for (std::size_t s = 0; s < model.skins.size(); ++s) {
    const auto& skin = model.skins[s];
    if (skin.inverseBindMatrices < 0) continue;
    const auto index = static_cast<std::size_t>(skin.inverseBindMatrices);
    if (seen[index]) continue;
    seen[index] = true;
    read_floats(model, skin.inverseBindMatrices, values);
    for (std::size_t i = 0; i + 16 <= values.size(); i += 16) {
      const bool affine = std::abs(values[i + 3]) <= kAffineTolerance &&
                          std::abs(values[i + 7]) <= kAffineTolerance &&
                          std::abs(values[i + 11]) <= kAffineTolerance &&
                          std::abs(values[i + 15] - 1.0f) <= kAffineTolerance;
      if (affine) continue;
      issues.invalid("ACCESSOR_INVALID_IBM", fmt::format("/skins/{}/inverseBindMatrices", s),
                     fmt::format("the fourth row of matrix {} is not 0 0 0 1", i / 16));
      return;
    }
  }
}

}  // namespace

void check_data(const tinygltf::Model& model, Issues& issues) {
  for (std::size_t i = 0; i < model.accessors.size() && !issues.failed(); ++i) {
    check_sparse_indices(model, i, issues);
    if (!issues.failed()) check_floats(model, i, issues);
  }
  if (issues.failed()) return;
  LargestValues largest(model);
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    const auto& primitives = model.meshes[m].primitives;
    for (std::size_t p = 0; p < primitives.size() && !issues.failed(); ++p) {
      check_indices(model, primitives[p], fmt::format("/meshes/{}/primitives/{}", m, p), largest,
                    issues);
    }
  }
  if (!issues.failed()) check_joints(model, largest, issues);
  if (!issues.failed()) check_times(model, issues);
  if (!issues.failed()) check_bind_matrices(model, issues);
}

}  // namespace octrace::gltf
