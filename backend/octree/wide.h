// Rewrites an octree into the nodes that the CPU walks (kernels/cpu/wide_node.h).
#pragma once

#include "backend/octree/octree.h"
#include "backend/util/huge_array.h"
#include "kernels/cpu/wide_node.h"

namespace octrace::octree {

struct WideOctree {
  util::HugeArray<kernels::WideUnit> units;
  kernels::Vec3 lower{0.0f}, upper{0.0f};

  kernels::WideView view() const;
  std::uint64_t bytes() const { return units.size() * sizeof(kernels::WideUnit); }
};

// Subtrees of up to eight triangles become leaves, and leaves of a node that lie together are
// merged. Empty where there is nothing to hit, where the octree is broken (walks of its own nodes
// report how) or has more triangles than a WideRef can name; walks then use the octree's own nodes.
// The same for every number of threads.
WideOctree make_wide(const kernels::OctreeView& octree);

}  // namespace octrace::octree
