// From the top of a binary tree to an octree.
#pragma once

#include "backend/octree/octree.h"
#include "backend/octree/top_tree.h"

namespace octrace::octree {

// Subtrees of a few units are each built, planned and written by one thread while they are in its
// cache: the whole binary tree never exists. Roots of subtrees are eight-way nodes; which ranges
// those are to be is guessed beforehand, so well that rays visit no more nodes than in a tree that
// was planned as a whole (docs/performance.md). `references` lie in the memory of the octree's
// triangles, which are written over them. False: the octree would be deeper than kMaxDepth, or a
// binary tree is too deep to be planned; what is in it is of no use.
bool build_subtrees(const TopTree& top, const TopOptions& options, std::uint32_t leaf_triangles,
                    const BuildInput& input, const LooseReference* references, Octree& octree);

}  // namespace octrace::octree
