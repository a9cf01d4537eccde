// From a binary tree to eight-way nodes.
#pragma once

#include "backend/octree/binary_tree.h"
#include "backend/octree/octree.h"

namespace octrace::octree {

// Chooses by dynamic programming which binary nodes become eight-way nodes, leaves or nothing, so
// that the expected cost of a ray by the surface-area heuristic is least (Ylitie, Karras, Laine
// 2017, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", section 3), and
// writes nodes and triangles. Uses the tree up. False, and nothing written: the octree would be
// deeper than kMaxDepth.
bool collapse(BinaryTree& tree, std::uint32_t leaf_triangles, const BuildInput& input,
              Octree& octree);

}  // namespace octrace::octree
