// The octree of the seed paper (kernels/seed.h), built as plainly as the paper says. The product's
// own median builder (backend/octree/build_median.cpp) makes the same splits in another way and
// another node format.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/seed.h"

namespace octrace::bench {

struct SeedTree {
  std::vector<kernels::SeedNode> nodes;
  std::vector<std::uint32_t> ids;
  std::uint32_t depth = 0;  // nodes on the longest path from the root

  kernels::SeedView view(std::span<const kernels::Triangle> triangles,
                         std::span<const kernels::Vec3> positions) const;
};

// Sorts the vertices by (x, index), halves them; each half by (y, index), each quarter by
// (z, index); eight children; recurs until a node has at most `threshold` vertices. What the paper
// leaves open is closed as in the product: a triangle belongs to the leaf of its first corner,
// boxes hold triangles, children without triangles are left out.
SeedTree build_seed_tree(std::span<const kernels::Vec3> positions,
                         std::span<const kernels::Triangle> triangles, std::uint32_t threshold);

}  // namespace octrace::bench
