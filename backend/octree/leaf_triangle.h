#pragma once

#include "backend/octree/octree.h"

namespace octrace::octree {

inline kernels::LeafTriangle leaf_triangle(const BuildInput& input, std::uint32_t id) {
  const kernels::Triangle& t = input.triangles[id];
  const std::uint32_t geometry = input.triangle_geometry.empty() ? 0 : input.triangle_geometry[id];
  const std::uint32_t flags = input.flags.empty() ? 0 : input.flags[geometry];
  return {input.positions[t.a], id, input.positions[t.b], flags, input.positions[t.c], geometry};
}

}  // namespace octrace::octree
