// The SAH builders. `sah`: the top of a binary tree with cuts (top_tree.h, top_cells.h), subtrees
// in cache below (build_subtrees.h), with re-insertion (reinsert.h) of what is large. `quality`: a
// whole binary tree with more cuts (build_binary.h), more of it re-inserted, collapsed into
// eight-way nodes (collapse.h).
#include <algorithm>
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

// Share of triangles from which a tree counts as one with cuts.
constexpr double kManyCuts = 0.01;

ReinsertOptions reinsert_options(const BinaryTree& tree) {
  ReinsertOptions options;
  options.rounds = 10;
  const std::uint32_t references = tree.nodes[BinaryTree::kRoot].plan;
  options.most = std::max(references / 5, 1u);  // a tenth of the nodes
  options.steps = kReinsertSteps;
  return options;
}

// False: too deep.
bool build_fast(const BuildInput& input, const TopOptions& options, std::uint32_t leaf_triangles,
                Octree& octree) {
  // References and their leaf triangles share one memory. Of cut triangles there may be more.
  const auto triangles = input.triangles.size();
  octree.triangles.reserve(triangles + static_cast<std::size_t>(double{options.duplicates} *
                                                                static_cast<double>(triangles)));
  octree.triangles.resize(triangles);
  auto* const references = reinterpret_cast<LooseReference*>(octree.triangles.data());
  const TopTree top = split_top(input, options, references);
  return build_subtrees(top, options, leaf_triangles, input, references, octree);
}

bool build_quality(const BuildInput& input, const SahOptions& options, bool reinserts,
                   Octree& octree) {
  BinaryOptions binary = quality_options();
  if (!options.cuts) binary.duplicates = 0.0f;
  BinaryTree tree = build_binary(input, binary);
  if (reinserts) reinsert(tree.nodes.data(), tree.nodes.size(), reinsert_options(tree));
  return collapse(tree, options.leaf_triangles, input, octree);
}

TopOptions fast_options(bool cuts, bool reinserts) {
  TopOptions options;
  if (!cuts) options.duplicates = 0.0f;
  if (!reinserts) options.reinsert_rounds = 0;
  return options;
}

}  // namespace

void build_sah(const BuildInput& input, const SahOptions& options, Octree& octree) {
  if (input.triangles.empty()) return;
  // Re-insertion may make a tree too deep. Where it is not to blame, the second build fails as
  // well: such scenes are rare.
  for (const bool reinserts : {true, false}) {
    if (options.quality ? build_quality(input, options, reinserts, octree)
                        : build_fast(input, fast_options(options.cuts, reinserts),
                                     options.leaf_triangles, octree)) {
      const auto triangles = static_cast<double>(input.triangles.size());
      octree.cut = static_cast<double>(octree.triangles.size()) > triangles * (1.0 + kManyCuts);
      return;
    }
  }
  // Too deep as it is: halves of fewer than 2^31 references by rank are at most 31 binary levels,
  // and there are no more eight-way ones.
  TopOptions plain = fast_options(false, false);
  plain.sah_depth = 0;
  if (!build_fast(input, plain, options.leaf_triangles, octree)) {
    throw std::logic_error("an octree of halves by rank is too deep");
  }
}

std::uint64_t sah_build_bytes(std::uint64_t triangles, const SahOptions& options) {
  const auto count = static_cast<double>(triangles);
  if (!options.quality) {
    // Measured: at most so many nodes a reference, which are held twice for a moment.
    constexpr double kNodes[] = {0.36, 0.28, 0.22};  // of one, two and three triangles a leaf
    const double nodes = kNodes[std::clamp(options.leaf_triangles, 1u, 3u) - 1];
    // Parts of triangles are listed, in vectors that may have twice the room, and their leaf
    // triangles wait for their places.
    constexpr double kPart = 2 * sizeof(LooseReference) + sizeof(kernels::LeafTriangle);
    const double parts = count * double{fast_options(options.cuts, true).duplicates};
    return static_cast<std::uint64_t>(
        (count + parts) * (sizeof(LooseReference) + 2 * nodes * sizeof(kernels::Node)) +
        parts * kPart);
  }
  constexpr double kReferences = 2 * sizeof(Reference), kTree = 2 * sizeof(BinaryNode);
  const double references =
      count * (1.0 + (options.cuts ? double{quality_options().duplicates} : 0.0));
  return static_cast<std::uint64_t>(references * (kReferences + kTree));
}

}  // namespace octrace::octree
