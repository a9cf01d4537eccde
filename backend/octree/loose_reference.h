// What the references in place of leaf triangles are made of.
#pragma once

#include "backend/octree/binary_tree.h"
#include "backend/octree/builders.h"

namespace octrace::octree {

inline LooseReference loose_reference(const BuildInput& input, std::uint32_t triangle,
                                      const Box& box) {
  const kernels::Triangle& t = input.triangles[triangle];
  const std::uint32_t geometry =
      input.triangle_geometry.empty() ? 0 : input.triangle_geometry[triangle];
  return {{box.lower[0], box.lower[1], box.lower[2]},
          triangle,
          {-box.upper[0], -box.upper[1], -box.upper[2]},
          0,
          {t.a, t.b, t.c, geometry}};
}

inline Bounds8 bounds8(const Box& box, const Box& centres) {
  Bounds8 bounds;
  for (int axis = 0; axis < 3; ++axis) {
    bounds.box[axis] = box.lower[axis];
    bounds.box[4 + axis] = -box.upper[axis];
    bounds.centres[axis] = centres.lower[axis];
    bounds.centres[4 + axis] = -centres.upper[axis];
  }
  return bounds;
}

}  // namespace octrace::octree
