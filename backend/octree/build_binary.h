// Top-down builds of the binary tree with spatial splits.
#pragma once

#include "backend/octree/binary_tree.h"

namespace octrace::octree {

struct BinaryOptions {
  int bins = 16;
  int sah_depth = 64;  // binary levels; below that, ranges are halved by rank
  // Spatial splits: at most this share of the triangles more references, where the sides of the
  // best object split reach into each other by more than this part of the root's surface
  // (ObjectSplit::overlap). 0: none.
  int spatial_bins = 8;
  float duplicates = 0.0f;
  float least_overlap = 1e-3f;
  float least_own_overlap = 0.0f;  // and of the node's own
  // Spatial splits are no longer tried below so many nodes in line that had no use for one.
  int spatial_misses = 4;
};

// Leaves are single references. Needs at least one triangle.
BinaryTree build_binary(const BuildInput& input, const BinaryOptions& options);

}  // namespace octrace::octree
