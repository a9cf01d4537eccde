// EXT_mesh_gpu_instancing: a node whose mesh is shown once for each element of its accessors.
#pragma once

#include <cstdint>
#include <optional>

#include "backend/gltf/issues.h"
#include "backend/gltf/json_ref.h"
#include "backend/gltf/structure.h"
#include "backend/gltf/tinygltf.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

inline constexpr const char* kInstancingExtension = "EXT_mesh_gpu_instancing";

// Accessors of a node's instances; -1: none. Others, such as _ID, only take part in `count`.
struct InstanceAccessors {
  int translation = -1;  // VEC3
  int rotation = -1;     // VEC4, x y z w
  int scale = -1;        // VEC3
  std::uint64_t count = 0;
};

// Nothing where the node has no mesh, for which the extension defines nothing.
std::optional<InstanceAccessors> instance_accessors(const tinygltf::Node& node,
                                                    const tinygltf::Model& model);

// The stages of validation, in their order. The extension's codes are octrace's own, because the
// Khronos validator does not know it.
void check_instancing(const JsonRef& node, const Sizes& sizes);
void check_instancing_links(const tinygltf::Model& model, const util::Limits& limits,
                            Issues& issues);
// Needs all floats checked to be finite.
void check_instance_rotations(const tinygltf::Model& model, Issues& issues);

}  // namespace octrace::gltf
