// The same ranges for any number of threads: bins are filled by minima and integer sums, which do
// not depend on order; bounds are joined in the order of fixed blocks; and the k-th reference that
// is misplaced on one side of a split changes places with the k-th of the other side.
#include "backend/octree/top_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

#include "backend/octree/builders.h"
#include "backend/octree/exchange.h"
#include "backend/octree/reference_blocks.h"

namespace octrace::octree {

namespace {

// From how few references on a range is a subtree. Its root is an eight-way node of its own, so
// above it there should be room for whole levels of those, as in a tree of triangles / 8^m each;
// half as many more, because halves are uneven. Other sizes up to the most gave up to a tenth more
// nodes a ray.
std::uint32_t subtree_size(std::uint32_t triangles) {
  std::uint64_t size = std::uint64_t{3} * triangles / 2;
  while (size > kMostInSubtree) size /= kernels::kChildren;
  return static_cast<std::uint32_t>(std::max<std::uint64_t>(size, 1));
}

class TopSplitter {
 public:
  TopSplitter(const BuildInput& input, const TopOptions& options, LooseReference* references)
      : input_(input),
        options_(options),
        references_(references),
        subtree_(subtree_size(static_cast<std::uint32_t>(input.triangles.size()))) {}

  TopTree run() {
    TopTree tree;
    tree.root = std::make_unique<TopRange>();
    TopRange& root = *tree.root;
    root.count = static_cast<std::uint32_t>(input_.triangles.size());
    root.bounds = make_references(root.count);
    const float overlap = split(root), area = root.bounds.half_area();
    tree.overlap = area > 0.0f ? overlap / area : 0.0f;
    list(root, tree.subtrees);
    return tree;
  }

 private:
  Bounds8 make_references(std::uint32_t count) {
    std::vector<Bounds8> bounds(blocks_of(count));
    for_blocks(count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t own) {
      bounds[block] = make_references(first, own);
    });
    Bounds8 all;
    for (const Bounds8& block : bounds) all = joined(all, block);
    return all;
  }
  Bounds8 make_references(std::uint32_t first, std::uint32_t count) {
    const std::uint32_t* const geometries =
        input_.triangle_geometry.empty() ? nullptr : input_.triangle_geometry.data();
    Box box, centres;
    for (std::uint32_t i = first; i < first + count; ++i) {
      const kernels::Triangle& t = input_.triangles[i];
      const Box own = triangle_box(input_, i);
      box.add(own);
      centres.add(own.centre2());
      std::construct_at(references_ + i,
                        LooseReference{{own.lower[0], own.lower[1], own.lower[2]},
                                       i,
                                       {-own.upper[0], -own.upper[1], -own.upper[2]},
                                       0,
                                       {t.a, t.b, t.c, geometries ? geometries[i] : 0}});
    }
    Bounds8 bounds;
    for (int axis = 0; axis < 3; ++axis) {
      bounds.box[axis] = box.lower[axis];
      bounds.box[4 + axis] = -box.upper[axis];
      bounds.centres[axis] = centres.lower[axis];
      bounds.centres[4 + axis] = -centres.upper[axis];
    }
    return bounds;
  }

  // Half the surface of what the sides of a split share, less the faces towards the sides, which
  // any two neighbours share.
  static float lateral_overlap(const Bounds8& lower, const Bounds8& upper, int axis) {
    float shared[3];
    for (int i = 0; i < 3; ++i) {
      shared[i] =
          std::min(lower.upper(i), upper.upper(i)) - std::max(lower.lower(i), upper.lower(i));
      if (!(shared[i] > 0.0f)) return 0.0f;
    }
    return shared[axis] * (shared[(axis + 1) % 3] + shared[(axis + 2) % 3]);
  }

  // Returns the most that the two sides of a split share.
  float split(TopRange& range) {
    if (range.count <= subtree_) return 0.0f;
    range.lower = std::make_unique<TopRange>();
    range.upper = std::make_unique<TopRange>();
    TopRange &lower = *range.lower, &upper = *range.upper;
    float overlap = divide(range, lower, upper);
    lower.first = range.first;
    upper.first = range.first + lower.count;
    upper.count = range.count - lower.count;
    lower.depth = upper.depth = range.depth + 1;
    float below[2];
    tbb::parallel_invoke([&] { below[0] = split(lower); }, [&] { below[1] = split(upper); });
    return std::max({overlap, below[0], below[1]});
  }

  // Sorts the references, counts those of the lower side and finds both sides' bounds. Returns what
  // the sides share.
  float divide(const TopRange& range, TopRange& lower, TopRange& upper) {
    LooseReference* const references = references_ + range.first;
    if (range.depth < options_.sah_depth) {
      const Binning binning(range.bounds, options_.bins);
      const ObjectBins bins = fill(references, range.count, binning);
      const ObjectSplit chosen = splitter_.best(bins, binning.bins);
      if (chosen.axis >= 0) {
        for (int bin = 0; bin < chosen.bin; ++bin) lower.count += bins.counts[chosen.axis][bin];
        if (part(references, range.count, lower.count, binning, chosen, lower.bounds,
                 upper.bounds)) {
          return lateral_overlap(lower.bounds, upper.bounds, chosen.axis);
        }
      }
    }
    lower.count = split_by_rank(references, range.count, range.bounds);
    lower.bounds = loose_.bounds(references, lower.count);
    upper.bounds = loose_.bounds(references + lower.count, range.count - lower.count);
    return 0.0f;
  }

  ObjectBins fill(const LooseReference* references, std::uint32_t count,
                  const Binning& binning) const {
    ObjectBins bins;
    bins.clear(binning.bins);
    if (count <= kParallel) {
      loose_.fill(references, count, binning, bins);
      return bins;
    }
    return tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, count, kParallel), bins,
        [&](const auto& r, ObjectBins sum) {
          loose_.fill(references + r.begin(), static_cast<std::uint32_t>(r.size()), binning, sum);
          return sum;
        },
        [&](ObjectBins a, const ObjectBins& b) {
          a.add(b, binning.bins);
          return a;
        });
  }

  // False, and nothing moved, where the bins counted otherwise, which only numbers that are none
  // could do.
  bool part(LooseReference* references, std::uint32_t count, std::uint32_t lower_count,
            const Binning& binning, const ObjectSplit& chosen, Bounds8& lower_bounds,
            Bounds8& upper_bounds) const {
    Half lower(references, lower_count, false);
    Half upper(references + lower_count, count - lower_count, true);
    tbb::parallel_invoke([&] { lower.search(loose_, binning, chosen); },
                         [&] { upper.search(loose_, binning, chosen); });
    if (lower.misplaced() != upper.misplaced()) return false;
    lower_bounds = joined(lower.bounds(0), upper.bounds(0));
    upper_bounds = joined(lower.bounds(1), upper.bounds(1));
    exchange(lower, upper);
    return true;
  }

  static void list(TopRange& range, std::vector<const TopRange*>& subtrees) {
    if (range.lower != nullptr) {
      list(*range.lower, subtrees);
      list(*range.upper, subtrees);
      return;
    }
    range.subtree = static_cast<std::uint32_t>(subtrees.size());
    subtrees.push_back(&range);
  }

  const BuildInput& input_;
  const TopOptions& options_;
  LooseReference* const references_;
  const std::uint32_t subtree_;
  const LooseSplitter loose_;
  const ObjectSplitter splitter_;
};

// A range splits at one of its references, and no other range does: the pair of its children has
// that number, and the range below has the pairs between.
struct WholeTree {
  const TopOptions& options;
  const LooseReference* references;
  BinaryTree& tree;
  tbb::enumerable_thread_specific<SubtreeRoom> rooms;

  void build(const TopRange& range, std::uint32_t root) {
    BinaryNode* const nodes = tree.nodes.data();
    if (range.lower == nullptr) {
      rooms.local().build(range, options, references, nodes, range.first + 1, root);
      return;
    }
    const std::uint32_t pair = range.upper->first;
    write_node(nodes[root], range.bounds, pair, range.count);
    tbb::parallel_invoke([&] { build(*range.lower, 2 * pair); },
                         [&] { build(*range.upper, 2 * pair + 1); });
  }
};

}  // namespace

TopTree split_top(const BuildInput& input, const TopOptions& options, LooseReference* references) {
  return TopSplitter(input, options, references).run();
}

SubtreeRoom::SubtreeRoom()
    : references_(std::make_unique_for_overwrite<Reference[]>(kMostInSubtree)),
      spare_(std::make_unique_for_overwrite<Reference[]>(kMostInSubtree)) {}

void SubtreeRoom::build(const TopRange& range, const TopOptions& options,
                        const LooseReference* references, BinaryNode* nodes, LocalTriangle* local) {
  for (std::uint32_t i = 0; i < range.count; ++i) {
    const LooseReference& from = references[range.first + i];
    local[i] = {from.corners, from.triangle};
  }
  loose_.pack(references + range.first, range.count, references_.get());
  for (std::uint32_t i = 0; i < range.count; ++i) references_[i].triangle = i;
  build(range, options, nodes, 1, BinaryTree::kRoot);
}

void SubtreeRoom::build(const TopRange& range, const TopOptions& options,
                        const LooseReference* references, BinaryNode* nodes,
                        std::uint32_t first_pair, std::uint32_t root) {
  loose_.pack(references + range.first, range.count, references_.get());
  build(range, options, nodes, first_pair, root);
}

void SubtreeRoom::build(const TopRange& range, const TopOptions& options, BinaryNode* nodes,
                        std::uint32_t first_pair, std::uint32_t root) {
  splitter_.subtree({references_.get(), spare_.get(), range.count, range.bounds, nodes, first_pair,
                     root, options.bins, std::max(options.sah_depth - range.depth, 0)});
}

BinaryTree build_below(const TopTree& top, const TopOptions& options,
                       const LooseReference* references) {
  BinaryTree tree;
  tree.nodes.resize(2 * std::uint64_t{top.root->count});
  WholeTree whole{options, references, tree, {}};
  whole.build(*top.root, BinaryTree::kRoot);
  return tree;
}

}  // namespace octrace::octree
