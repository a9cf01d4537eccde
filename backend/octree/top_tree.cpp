// The same ranges for any number of threads: bins are filled by minima and integer sums, which do
// not depend on order; bounds are joined in the order of fixed blocks; and the k-th reference that
// is misplaced on one side of a split changes places with the k-th of the other side. Of large
// scenes, top_cells.cpp makes the topmost splits before.
#include "backend/octree/top_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "backend/octree/builders.h"
#include "backend/octree/exchange.h"
#include "backend/octree/loose_reference.h"
#include "backend/octree/reference_blocks.h"
#include "backend/octree/top_cells.h"

namespace octrace::octree {

namespace {

// Cuts are made between units only, so that scenes of few triangles need small ones.
std::uint32_t unit_size(std::uint32_t triangles) {
  return std::clamp<std::uint32_t>(triangles / 64, 64, kMostInUnit);
}

std::uint32_t total(const TopRange& range) {
  return range.count + static_cast<std::uint32_t>(range.parts.size());
}

class TopSplitter {
 public:
  TopSplitter(const BuildInput& input, const TopOptions& options, LooseReference* references)
      : input_(input),
        options_(options),
        references_(references),
        unit_(unit_size(static_cast<std::uint32_t>(input.triangles.size()))) {}

  TopTree run() {
    TopTree tree;
    tree.root = std::make_unique<TopRange>();
    TopRange& root = *tree.root;
    root.count = static_cast<std::uint32_t>(input_.triangles.size());
    root.room = static_cast<std::uint32_t>(
        std::min(double{options_.duplicates} * root.count, 0x7fffffff - double(root.count)));
    make_references(root);
    root_area_ = root.bounds.half_area();
    split(root);
    number(root, 0);
    return tree;
  }

 private:
  void make_references(TopRange& root) {
    if (root.count >= options_.least_for_cells &&
        split_by_cells(input_, options_, unit_, root, references_)) {
      return;
    }
    root.bounds = for_triangles(input_, [&](std::uint32_t i, const Box& box) {
      std::construct_at(references_ + i, loose_reference(input_, i, box));
    });
  }

  void split(TopRange& range) {
    if (total(range) <= unit_) return;
    if (range.lower == nullptr) halve(range);
    tbb::parallel_invoke([&] { split(*range.lower); }, [&] { split(*range.upper); });
  }

  void halve(TopRange& range) {
    range.lower = std::make_unique<TopRange>();
    range.upper = std::make_unique<TopRange>();
    TopRange &lower = *range.lower, &upper = *range.upper;
    // While it waits, this thread is not to begin with other ranges, which would keep those below
    // this one waiting.
    tbb::this_task_arena::isolate([&] { divide(range, lower, upper); });
    lower.first = range.first;
    upper.first = range.first + lower.count;
    upper.count = range.count - lower.count;
    hand_down(range);
    Parts().swap(range.parts);
  }

  // Sorts the references, counts those of the lower side and finds both sides' bounds.
  void divide(TopRange& range, TopRange& lower, TopRange& upper) {
    if (range.depth < options_.sah_depth) {
      const Binning binning(range.bounds, options_.bins);
      const ObjectBins bins = fill(range, binning);
      const ObjectSplit chosen = splitter_.best(bins, binning.bins);
      lower.misses = upper.misses = range.misses;
      if (range.room != 0 && range.misses < options_.spatial_misses &&
          chosen.overlap > options_.least_overlap * root_area_) {
        const bool cut = divide_space(range, chosen.cost, lower, upper);
        lower.misses = upper.misses = cut ? 0 : range.misses + 1;
        if (cut) return;
      }
      if (chosen.axis >= 0) {
        const SidePlane plane(binning, chosen);
        for (int bin = 0; bin < chosen.bin; ++bin) lower.count += bins.counts[chosen.axis][bin];
        for (const LooseReference& part : range.parts) lower.count -= plane.lower_side(part);
        if (part(range, plane, lower, upper)) return;
      }
    }
    divide_by_rank(range, lower, upper);
  }

  // False, and nothing changed: that would not be cheaper, or there is no room for the parts.
  bool divide_space(TopRange& range, float cost, TopRange& lower, TopRange& upper) const {
    const LooseRange loose{references_ + range.first, range.count, range.parts};
    const SpatialSplit chosen =
        best_cut(input_, loose_, loose, range.bounds, range.room, options_.spatial_bins);
    if (!(chosen.cost < cost)) return false;
    const std::size_t before = range.parts.size();
    const std::uint32_t below = cut_at(input_, loose, range.room, chosen);
    if (below == kernels::kNone) return false;
    range.room -= static_cast<std::uint32_t>(range.parts.size() - before);
    lower.count = below;
    if (!part(range, SidePlane(chosen.axis, chosen.plane), lower, upper)) {
      divide_by_rank(range, lower, upper);
    }
    return true;
  }

  void divide_by_rank(TopRange& range, TopRange& lower, TopRange& upper) const {
    LooseReference* const references = references_ + range.first;
    lower.count = split_by_rank(references, range.count, range.bounds);
    const auto half = range.parts.begin() + static_cast<std::ptrdiff_t>(range.parts.size() / 2);
    lower.parts.assign(range.parts.begin(), half);
    upper.parts.assign(half, range.parts.end());
    lower.bounds = joined(loose_.bounds(references, lower.count), bounds_of(lower.parts));
    upper.bounds = joined(loose_.bounds(references + lower.count, range.count - lower.count),
                          bounds_of(upper.parts));
  }

  Bounds8 bounds_of(const Parts& parts) const {
    return loose_.bounds(parts.data(), static_cast<std::uint32_t>(parts.size()));
  }

  ObjectBins fill(const TopRange& range, const Binning& binning) const {
    ObjectBins bins = fill(references_ + range.first, range.count, binning);
    loose_.fill(range.parts.data(), static_cast<std::uint32_t>(range.parts.size()), binning, bins);
    return bins;
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

  // The lower side's count is known. False, and nothing moved, where the bins counted otherwise,
  // which only numbers that are none could do.
  bool part(const TopRange& range, const SidePlane& plane, TopRange& lower, TopRange& upper) const {
    LooseReference* const references = references_ + range.first;
    Half low(references, lower.count, false);
    Half high(references + lower.count, range.count - lower.count, true);
    tbb::parallel_invoke([&] { low.search(loose_, plane); }, [&] { high.search(loose_, plane); });
    if (low.misplaced() != high.misplaced()) return false;
    for (const LooseReference& reference : range.parts) {
      (plane.lower_side(reference) ? lower : upper).parts.push_back(reference);
    }
    lower.bounds = joined(joined(low.bounds(0), high.bounds(0)), bounds_of(lower.parts));
    upper.bounds = joined(joined(low.bounds(1), high.bounds(1)), bounds_of(upper.parts));
    exchange(low, high);
    return true;
  }

  static void number(TopRange& range, std::uint32_t place) {
    range.place = place;
    range.size = total(range);
    if (range.lower == nullptr) return;
    number(*range.lower, place);
    number(*range.upper, place + range.lower->size);
    range.size = range.lower->size + range.upper->size;
  }

  const BuildInput& input_;
  const TopOptions& options_;
  LooseReference* const references_;
  const std::uint32_t unit_;
  float root_area_ = 0.0f;
  const LooseSplitter loose_;
  const ObjectSplitter splitter_;
};

}  // namespace

void hand_down(TopRange& range) {
  TopRange &lower = *range.lower, &upper = *range.upper;
  lower.depth = upper.depth = range.depth + 1;
  lower.room = static_cast<std::uint32_t>(std::uint64_t{range.room} * total(lower) /
                                          (std::uint64_t{total(lower)} + total(upper)));
  upper.room = range.room - lower.room;
}

TopTree split_top(const BuildInput& input, const TopOptions& options, LooseReference* references) {
  return TopSplitter(input, options, references).run();
}

SubtreeRoom::SubtreeRoom()
    : references_(std::make_unique_for_overwrite<Reference[]>(kMostInUnit)),
      spare_(std::make_unique_for_overwrite<Reference[]>(kMostInUnit)) {}

void SubtreeRoom::build(const TopRange& range, const TopOptions& options,
                        const LooseReference* references, BinaryNode* nodes, LocalTriangle* local) {
  build({options, references, range.place, nodes, local}, range, BinaryTree::kRoot);
}

// A range splits at one of its references, and no other range does: the pair of its children has
// that number, and the range below has the pairs between.
void SubtreeRoom::build(const Work& work, const TopRange& range, std::uint32_t root) {
  if (range.lower == nullptr) {
    build_unit(work, range, root);
    return;
  }
  const std::uint32_t pair = range.upper->place - work.base;
  write_node(work.nodes[root], range.bounds, pair, range.size);
  build(work, *range.lower, 2 * pair);
  build(work, *range.upper, 2 * pair + 1);
}

void SubtreeRoom::build_unit(const Work& work, const TopRange& unit, std::uint32_t root) {
  const std::uint32_t first = unit.place - work.base;
  const LooseReference* const own = work.references + unit.first;
  loose_.pack(own, unit.count, references_.get());
  loose_.pack(unit.parts.data(), unit.size - unit.count, references_.get() + unit.count);
  LocalTriangle* local = work.local + first;
  const auto name = [&](const LooseReference& from) { *local++ = {from.corners, from.triangle}; };
  std::for_each_n(own, unit.count, name);
  std::for_each(unit.parts.begin(), unit.parts.end(), name);
  for (std::uint32_t i = 0; i < unit.size; ++i) references_[i].triangle = first + i;
  splitter_.subtree({references_.get(), spare_.get(), unit.size, unit.bounds, work.nodes, first + 1,
                     root, work.options.unit_bins,
                     std::max(work.options.sah_depth - unit.depth, 0)});
}

}  // namespace octrace::octree
