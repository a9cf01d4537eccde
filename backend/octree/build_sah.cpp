// The SAH builders: a binary tree from above (top_tree.h, build_binary.h), improved by reinsertion
// (reinsert.h), collapsed into eight-way nodes (collapse.h). In large scenes where reinsertion has
// nothing to gain, the tree is never whole (build_subtrees.h).
#include <stdexcept>

#include "backend/octree/build_binary.h"
#include "backend/octree/build_subtrees.h"
#include "backend/octree/builders.h"
#include "backend/octree/collapse.h"
#include "backend/octree/reinsert.h"
#include "backend/octree/top_tree.h"

namespace octrace::octree {

namespace {

// Measured on bunny, sponza, terrain and soup: docs/performance.md.
BinaryOptions quality_options() {
  BinaryOptions options;
  options.bins = 32;
  options.spatial_bins = 32;
  options.duplicates = 0.5f;
  options.least_overlap = 3e-3f;
  options.least_own_overlap = 0.1f;
  return options;
}

// TopTree::overlap from which re-insertion is worth the whole binary tree, which it needs: bunny,
// terrain and soup have 0.001 to 0.006 and gain nothing from it, sponza has 0.24 and gains much.
constexpr float kWorthMoving = 0.02f;

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

// References and their leaf triangles share one memory; each triangle has one of either.
LooseReference* references_of(Octree& octree, std::size_t triangles) {
  octree.triangles.resize(triangles);
  return reinterpret_cast<LooseReference*>(octree.triangles.data());
}

// False: too deep.
bool build_fast(const BuildInput& input, std::uint32_t leaf_triangles,
                std::uint32_t least_for_subtrees, Octree& octree) {
  const TopOptions options;
  LooseReference* const references = references_of(octree, input.triangles.size());
  TopTree top = split_top(input, options, references);
  if (input.triangles.size() >= least_for_subtrees && top.subtrees.size() > 1 &&
      top.overlap <= kWorthMoving) {
    if (build_subtrees(top, options, leaf_triangles, input, references, octree)) return true;
    // Without forced roots of subtrees it may be less deep. Leaf triangles were written over the
    // references.
    top = split_top(input, options, references);
  }
  BinaryTree tree = build_below(top, options, references);
  reinsert(tree, reinsert_options(false));
  return collapse(tree, leaf_triangles, input, octree);
}

bool build_quality(const BuildInput& input, std::uint32_t leaf_triangles, Octree& octree) {
  BinaryTree tree = build_binary(input, quality_options());
  reinsert(tree, reinsert_options(true));
  if (!collapse(tree, leaf_triangles, input, octree)) return false;
  octree.cut = octree.triangles.size() > input.triangles.size() * (1.0 + kManyCuts);
  return true;
}

}  // namespace

void build_sah(const BuildInput& input, std::uint32_t leaf_triangles, bool quality, Octree& octree,
               std::uint32_t least_for_subtrees) {
  if (input.triangles.empty()) return;
  if (quality ? build_quality(input, leaf_triangles, octree)
              : build_fast(input, leaf_triangles, least_for_subtrees, octree)) {
    return;
  }
  // Too deep: halves of fewer than 2^31 references by rank are at most 31 binary levels, and there
  // are no more eight-way ones.
  TopOptions plain;
  plain.sah_depth = 0;
  LooseReference* const references = references_of(octree, input.triangles.size());
  const TopTree top = split_top(input, plain, references);
  BinaryTree tree = build_below(top, plain, references);
  if (!collapse(tree, leaf_triangles, input, octree)) {
    throw std::logic_error("an octree of halves by rank is too deep");
  }
}

std::uint64_t sah_build_bytes(std::uint64_t triangles, bool quality) {
  constexpr double kTree = 2 * sizeof(BinaryNode);
  const auto count = static_cast<double>(triangles);
  if (!quality) {
    // Where the binary tree is made as a whole; else nodes, of which there is one for six triangles
    // or more, are held twice in its place.
    constexpr double kDraft = sizeof(kernels::Node) / 6.0 + sizeof(std::uint32_t);
    return static_cast<std::uint64_t>(count * (sizeof(LooseReference) + kTree + kDraft));
  }
  constexpr double kReferences = 2 * sizeof(Reference);
  const double references = count * (1.0 + double{quality_options().duplicates});
  return static_cast<std::uint64_t>(references * (kReferences + kTree));
}

}  // namespace octrace::octree
