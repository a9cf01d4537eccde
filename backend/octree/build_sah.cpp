// The SAH builders: a binary tree from above (build_binary.h), improved by reinsertion
// (reinsert.h), collapsed into eight-way nodes (collapse.h).
#include "backend/octree/build_binary.h"
#include "backend/octree/builders.h"
#include "backend/octree/collapse.h"
#include "backend/octree/reinsert.h"

namespace octrace::octree {

namespace {

// Measured on bunny, sponza, terrain and soup: docs/performance.md.
BinaryOptions binary_options(bool quality) {
  BinaryOptions options;
  options.bins = quality ? 32 : 16;
  // Only quality cuts triangles: looking for cuts takes most of a build's time.
  options.spatial_bins = quality ? 32 : 0;
  options.duplicates = quality ? 0.5f : 0.0f;
  options.least_overlap = quality ? 3e-3f : 1e-3f;
  options.least_own_overlap = 0.1f;
  return options;
}

// Share of triangles from which a tree counts as one with cuts.
constexpr double kManyCuts = 0.01;

ReinsertOptions reinsert_options(bool quality) {
  ReinsertOptions options;
  // Most scenes have nothing to gain (under 0.06 of the root's surface); where there is, as in
  // sponza (15), many rounds that look at little each find it.
  options.rounds = quality ? 10 : 12;
  options.share = quality ? 0.1f : 0.001f;
  options.least_gain = quality ? 0.0f : 0.2f;
  options.follow = quality;
  options.last_gain = quality ? 0.02f : 0.0f;  // moves may take turns for ever
  return options;
}

}  // namespace

void build_sah(const BuildInput& input, std::uint32_t leaf_triangles, bool quality,
               Octree& octree) {
  if (input.triangles.empty()) return;
  {
    BinaryTree tree = build_binary(input, binary_options(quality));
    reinsert(tree, reinsert_options(quality));
    if (collapse(tree, leaf_triangles, input, octree)) {
      octree.cut = octree.triangles.size() > input.triangles.size() * (1.0 + kManyCuts);
      return;
    }
  }
  // Too deep: halves by rank need at most 32 binary levels, so fewer eight-way ones.
  BinaryOptions plain;
  plain.sah_depth = 0;
  BinaryTree tree = build_binary(input, plain);
  collapse(tree, leaf_triangles, input, octree);
}

std::uint64_t sah_build_bytes(std::uint64_t triangles, bool quality) {
  const double references =
      static_cast<double>(triangles) * (1.0 + double{binary_options(quality).duplicates});
  constexpr double kReferences = 2 * sizeof(Reference), kNodes = 2 * sizeof(BinaryNode);
  return static_cast<std::uint64_t>(references * (kReferences + kNodes));
}

}  // namespace octrace::octree
