// The builders behind octree::build(). Each sorts `ids` (the triangles' indices) so that leaves are
// runs of it, and returns the root; null where there is no triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/octree/tree.h"

namespace octrace::octree {

// The seed paper's octree (Wang, Ren, Zhao, Sun 2012): median splits of the vertices.
TreeNode* build_median(const BuildInput& input, std::uint32_t leaf_vertices, TreeArena& arena,
                       std::vector<std::uint32_t>& ids);

// Eight-way nodes by the surface-area heuristic.
TreeNode* build_sah(const BuildInput& input, std::uint32_t leaf_triangles, TreeArena& arena,
                    std::vector<std::uint32_t>& ids);

inline Box triangle_box(const BuildInput& input, std::uint32_t triangle) {
  const kernels::Triangle& t = input.triangles[triangle];
  Box box;
  box.add(float4(input.positions[t.a]));
  box.add(float4(input.positions[t.b]));
  box.add(float4(input.positions[t.c]));
  return box;
}

}  // namespace octrace::octree
