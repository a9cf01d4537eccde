#pragma once

#include "backend/octree/binary_tree.h"

namespace octrace::octree {

struct ReinsertOptions {
  int rounds = 0;
  // Of the nodes, those of the largest surfaces, that the first round looks at; later ones look at
  // what the one before left undone or changed.
  float share = 0.01f;
  float last_gain = 0.0f;  // a round that gains at most this part of the first is the last
};

// Takes subtrees out and puts them where the sum of all surfaces becomes least (Meister and Bittner
// 2018, "Parallel reinsertion for bounding volume hierarchy optimization"): threads search, one
// applies the moves that do not touch each other, those of the largest gains first, so that the
// tree does not depend on the number of threads. Boxes stay tight.
void reinsert(BinaryTree& tree, const ReinsertOptions& options);

}  // namespace octrace::octree
