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

// From how many triangles on subtrees are built in cache (build_subtrees.h). That takes a sixth
// less time, and of smaller scenes some would pay for it with up to 4 % more nodes a ray
// (docs/performance.md); larger ones hardly do.
inline constexpr std::uint32_t kLeastForSubtrees = 1u << 17;

// By the surface-area heuristic: a binary tree, improved and collapsed. `quality`: more time for
// fewer tests a ray.
void build_sah(const BuildInput& input, std::uint32_t leaf_triangles, bool quality, Octree& octree,
               std::uint32_t least_for_subtrees = kLeastForSubtrees);
// The most memory that takes beside the scene, the octree included.
std::uint64_t sah_build_bytes(std::uint64_t triangles, bool quality);

inline Box triangle_box(const BuildInput& input, std::uint32_t triangle) {
  const kernels::Triangle& t = input.triangles[triangle];
  Box box;
  box.add(float4(input.positions[t.a]));
  box.add(float4(input.positions[t.b]));
  box.add(float4(input.positions[t.c]));
  return box;
}

}  // namespace octrace::octree
