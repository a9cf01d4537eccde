// Passes over a scene's triangles, and the references in place of leaf triangles made in them.
#pragma once

#include <vector>

#include "backend/octree/binary_tree.h"
#include "backend/octree/builders.h"
#include "backend/octree/reference_blocks.h"

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

// Calls visit(triangle, box) for all triangles, at the same time where there are many. Returns
// their bounds.
template <class Visit>
Bounds8 for_triangles(const BuildInput& input, const Visit& visit) {
  const auto count = static_cast<std::uint32_t>(input.triangles.size());
  std::vector<Bounds8> bounds(blocks_of(count));
  for_blocks(count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t own) {
    Box box, centres;
    for (std::uint32_t i = first; i < first + own; ++i) {
      const Box of_triangle = triangle_box(input, i);
      box.add(of_triangle);
      centres.add(of_triangle.centre2());
      visit(i, of_triangle);
    }
    for (int axis = 0; axis < 3; ++axis) {
      bounds[block].box[axis] = box.lower[axis];
      bounds[block].box[4 + axis] = -box.upper[axis];
      bounds[block].centres[axis] = centres.lower[axis];
      bounds[block].centres[4 + axis] = -centres.upper[axis];
    }
  });
  Bounds8 all;
  for (const Bounds8& block : bounds) all = joined(all, block);
  return all;
}

}  // namespace octrace::octree
