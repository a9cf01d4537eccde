// The same ranges for any number of threads: bins are filled by minima and integer sums, which do
// not depend on order; bounds are joined in the order of fixed blocks; and the k-th reference that
// is misplaced on one side of a split changes places with the k-th of the other side.
#include "backend/octree/top_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cstring>

#include "backend/octree/builders.h"

namespace octrace::octree {

namespace {

constexpr std::uint32_t kBlock = 4096;
constexpr std::uint32_t kParallel = 4 * kBlock;  // references worth a task

Bounds8 joined(Bounds8 a, const Bounds8& b) {
  for (int i = 0; i < 8; ++i) {
    a.box[i] = std::min(a.box[i], b.box[i]);
    a.centres[i] = std::min(a.centres[i], b.centres[i]);
  }
  return a;
}

// From how few references on a range is a subtree. Its root is an eight-way node of its own, so
// above it there should be room for whole levels of those, as in a tree of triangles / 8^m each;
// half as many more, because halves are uneven. Other sizes up to the most gave up to a tenth more
// nodes a ray.
std::uint32_t subtree_size(std::uint32_t triangles) {
  std::uint64_t size = std::uint64_t{3} * triangles / 2;
  while (size > kMostInSubtree) size /= kernels::kChildren;
  return static_cast<std::uint32_t>(std::max<std::uint64_t>(size, 1));
}

std::uint32_t blocks_of(std::uint32_t count) { return (count + kBlock - 1) / kBlock; }

// Calls body(block, first, count) for runs of references, at the same time where there are many.
template <class Body>
void for_blocks(std::uint32_t count, const Body& body) {
  const std::uint32_t blocks = blocks_of(count);
  const auto run = [&](std::uint32_t block) {
    body(block, block * kBlock, std::min(kBlock, count - block * kBlock));
  };
  if (count <= kParallel) {
    for (std::uint32_t block = 0; block < blocks; ++block) run(block);
  } else {
    tbb::parallel_for(0u, blocks, run);
  }
}

// One side of a split before its strangers have left it.
class Half {
 public:
  Half(LooseReference* references, std::uint32_t count, bool upper)
      : references_(references), count_(count), upper_(upper) {}

  // Threads write the notes of their own blocks' references.
  void search(const LooseSplitter& splitter, const Binning& binning, const ObjectSplit& split) {
    first_number_.resize(blocks_of(count_) + 1);
    std::vector<std::array<Bounds8, 2>> bounds(blocks_of(count_));
    for_blocks(count_, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
      Bounds8 own[2];
      first_number_[block + 1] =
          splitter.find_misplaced(references_ + first, count, upper_, binning, split, own);
      bounds[block] = {own[0], own[1]};
    });
    for (std::size_t i = 1; i < first_number_.size(); ++i) first_number_[i] += first_number_[i - 1];
    for (const auto& block : bounds) {
      for (int side = 0; side < 2; ++side) bounds_[side] = joined(bounds_[side], block[side]);
    }
  }

  std::uint32_t misplaced() const { return first_number_.back(); }
  const Bounds8& bounds(int side) const { return bounds_[side]; }

  // Numbers of the misplaced of a block: [first_number(block), first_number(block + 1)).
  std::uint32_t blocks() const { return blocks_of(count_); }
  std::uint32_t first_number(std::uint32_t block) const { return first_number_[block]; }
  std::uint32_t block_of(std::uint32_t number) const {
    return static_cast<std::uint32_t>(
        std::upper_bound(first_number_.begin(), first_number_.end(), number) -
        first_number_.begin() - 1);
  }
  LooseReference& in_block(std::uint32_t block, std::uint32_t i) const {
    LooseReference* const first = references_ + std::size_t{block} * kBlock;
    return first[first[i].note];
  }

 private:
  LooseReference* references_;
  std::uint32_t count_;
  bool upper_;
  std::vector<std::uint32_t> first_number_;  // by block, and the sum
  Bounds8 bounds_[2];                        // of what is in this half and belongs to either side
};

// Threads take the strangers of a block of the lower half each, and with them as many of the upper
// half that no other thread has. Notes stay where they are.
void exchange(const Half& lower, const Half& upper) {
  const auto run = [&](std::uint32_t block) {
    const std::uint32_t first = lower.first_number(block), last = lower.first_number(block + 1);
    if (first == last) return;
    std::uint32_t other = upper.block_of(first);
    for (std::uint32_t number = first; number < last; ++number) {
      while (number >= upper.first_number(other + 1)) ++other;
      LooseReference& a = lower.in_block(block, number - first);
      LooseReference& b = upper.in_block(other, number - upper.first_number(other));
      std::swap(a, b);
      std::swap(a.note, b.note);
    }
  };
  if (lower.blocks() * kBlock <= kParallel) {
    for (std::uint32_t block = 0; block < lower.blocks(); ++block) run(block);
  } else {
    tbb::parallel_for(0u, lower.blocks(), run);
  }
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
