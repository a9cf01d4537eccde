// The builders behind octree::build().
#pragma once

#include <cstdint>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/octree/tree.h"

namespace octrace::octree {

// The seed paper's octree (Wang, Ren, Zhao, Sun 2012): median splits of the vertices. Sorts `ids`
// (the triangles' indices) so that leaves are runs of it, and returns the root; null where there is
// no triangle.
TreeNode* build_median(const BuildInput& input, std::uint32_t leaf_vertices, TreeArena& arena,
                       std::vector<std::uint32_t>& ids);

struct SahOptions {
  std::uint32_t leaf_triangles = kernels::kMaxLeafTriangles;
  bool quality = false;  // more time for fewer tests a ray
  bool cuts = true;      // BuildOptions::cuts
};

// By the surface-area heuristic: a binary tree, collapsed into eight-way nodes.
void build_sah(const BuildInput& input, const SahOptions& options, Octree& octree);
// The most memory that takes beside the scene, the octree included.
std::uint64_t sah_build_bytes(std::uint64_t triangles, const SahOptions& options);

inline Box triangle_box(const BuildInput& input, std::uint32_t triangle) {
  const kernels::Triangle& t = input.triangles[triangle];
  Box box;
  box.add(float4(input.positions[t.a]));
  box.add(float4(input.positions[t.b]));
  box.add(float4(input.positions[t.c]));
  return box;
}

}  // namespace octrace::octree
