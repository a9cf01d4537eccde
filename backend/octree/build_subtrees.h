// The fast way from the top of a binary tree to an octree.
#pragma once

#include "backend/octree/octree.h"
#include "backend/octree/top_tree.h"

namespace octrace::octree {

// Each range of references is built, planned and written by one thread while it is in its cache,
// and its root is an eight-way node of its own, which costs at most a few percent more nodes a ray:
// the whole binary tree never exists. `references` lie in the memory of the octree's triangles,
// which are written over them. False: the octree would be deeper than kMaxDepth; what is in it is
// of no use. Needs at least two ranges.
bool build_subtrees(const TopTree& top, const TopOptions& options, std::uint32_t leaf_triangles,
                    const BuildInput& input, const LooseReference* references, Octree& octree);

}  // namespace octrace::octree
