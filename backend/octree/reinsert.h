#pragma once

#include <cstddef>
#include <limits>

#include "backend/octree/binary_tree.h"

namespace octrace::octree {

struct ReinsertOptions {
  int rounds = 0;
  // Of the nodes, so many of the largest surfaces, and none that is not larger than `least_area`,
  // are what the first round looks at; later ones look at what the one before left undone or
  // changed.
  std::size_t most = std::numeric_limits<std::size_t>::max();
  float least_area = -1.0f;  // half the surface
  // Nodes that one search looks at beside those above it. Where boxes overlap a lot, as those of
  // large triangles do, nothing rules out the rest of the tree.
  std::size_t steps = std::numeric_limits<std::size_t>::max();
  float last_gain = 0.02f;  // a round that gains at most this part of the first is the last
  bool parallel = true;     // searches may take all threads
};

// Takes subtrees out and puts them where the sum of all surfaces becomes least (Meister and Bittner
// 2018, "Parallel reinsertion for bounding volume hierarchy optimization"): threads search, one
// applies the moves that do not touch each other, those of the largest gains first, so that the
// tree does not depend on the number of threads. Boxes stay tight. The root is
// nodes[BinaryTree::kRoot], and there are at most `size` nodes. Returns whether anything was moved.
bool reinsert(BinaryNode* nodes, std::size_t size, const ReinsertOptions& options);

}  // namespace octrace::octree
