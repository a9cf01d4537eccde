// Scenes with instances whose transforms are hard on two levels of octrees.
#pragma once

#include <array>
#include <cstdint>
#include <ostream>
#include <vector>

#include "tests/unit/scene_support.h"

namespace octrace::tests {

struct InstanceShape {
  const char* name;
  double size = 1.0;  // of the whole, metres
  std::array<float, 2> scale{0.2f, 1.0f};
  bool mirrors = false;
  nlohmann::json parent = nullptr;  // matrix of the parent node
  float centre = 0.0f;              // of the mesh, in its own units
  bool flat = false;                // a mesh without thickness, scaled by 0 along it
};
inline void PrintTo(const InstanceShape& shape, std::ostream* stream) { *stream << shape.name; }

// Triangles of 108, each with corners of its own.
std::vector<float> bumpy_ball(float centre, bool flat);

// `count` instances of one ball about the origin, and a floor under them that is no instance.
// Nodes: the instances', its parent, the floor.
scene::testing::GltfFile make_instanced_file(const InstanceShape& shape, int count,
                                             std::uint64_t seed);
scene::Scene make_instanced_scene(const InstanceShape& shape, int count, std::uint64_t seed);

// Plain, mirrored, sheared, tiny, huge, of very different scales, far from the mesh's own origin,
// flat.
std::vector<InstanceShape> instance_shapes();

}  // namespace octrace::tests
