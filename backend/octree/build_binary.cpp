// For `--builder quality`: references go from one array to another, with room for the parts that
// spatial splits make; subtrees of few references without spatial splits are left to one thread
// each (object_split.cpp). The default builder cuts at the top only, in less memory (top_tree.h).
//
// The same tree for any number of threads: bins are filled by minima and integer sums, which do not
// depend on order; references are scattered in order of fixed blocks; room is shared out by size.
#include "backend/octree/build_binary.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <vector>

#include "backend/octree/builders.h"
#include "backend/octree/object_split.h"
#include "backend/octree/reference_blocks.h"
#include "backend/octree/spatial_split.h"
#include "backend/util/huge_vector.h"

namespace octrace::octree {

namespace {

constexpr std::uint32_t kSubtree = 4096;     // references that one thread takes at once
constexpr std::uint32_t kLeastSpatial = 32;  // references worth a spatial split

// References [first, first + count) of an array, with room for `room` more after them. The range
// owns the pairs [pair, pair + count + room - 1).
struct Range {
  std::uint32_t first, count, room, pair;
};

struct Chosen {
  ObjectSplit object;
  SpatialSplit spatial;
  int misses = 0;  // nodes in line, this one the last, where a spatial split was no better
};

// Where a reference goes: bit 0: to the lower side; bit 1: to the upper one.
enum Side : unsigned { kLower = 1, kUpper = 2, kBoth = 3 };

class BinaryBuilder {
 public:
  BinaryBuilder(const BuildInput& input, const BinaryOptions& options)
      : input_(input), options_(options) {}

  BinaryTree run() {
    const auto count = static_cast<std::uint32_t>(input_.triangles.size());
    const auto room = static_cast<std::uint32_t>(
        std::min<double>(double{options_.duplicates} * count, 0x7fffffff - double(count)));
    const std::uint64_t most = std::uint64_t{count} + room;
    for (auto& references : references_) references.resize(most);
    tree_.nodes.resize(2 * most);
    tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count, kBlock), [&](const auto& r) {
      for (std::uint32_t i = r.begin(); i < r.end(); ++i) {
        const Box box = triangle_box(input_, i);
        references_[0][i] = {{box.lower[0], box.lower[1], box.lower[2]},
                             i,
                             {-box.upper[0], -box.upper[1], -box.upper[2]},
                             0};
      }
    });
    const Bounds8 bounds = bounds_of(references_[0].data(), count);
    root_area_ = bounds.half_area();
    build({0, count, room, 1}, BinaryTree::kRoot, bounds, 0, 0, 0);
    return std::move(tree_);
  }

 private:
  // Joined in the order of fixed blocks: which of 0 and -0 is the lesser depends on the order.
  Bounds8 bounds_of(const Reference* references, std::uint32_t count) const {
    std::vector<Bounds8> bounds(blocks_of(count));
    for_blocks(count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t own) {
      bounds[block] = splitter_.bounds(references + first, own);
    });
    Bounds8 all;
    for (const Bounds8& block : bounds) all = joined(all, block);
    return all;
  }

  // A subtree that no spatial split can help: neither it nor anything below it is large enough.
  bool simple(const Range& range, const Bounds8& bounds) const {
    return range.room == 0 || range.count < kLeastSpatial ||
           !(bounds.half_area() > options_.least_overlap * root_area_);
  }

  // `array`: which of the two holds the references.
  void build(const Range& range, std::uint32_t root, const Bounds8& bounds, int array, int depth,
             int misses) {
    Reference* references = references_[array].data() + range.first;
    if (range.count <= kSubtree && simple(range, bounds)) {
      splitter_.subtree({references, references_[1 - array].data() + range.first, range.count,
                         bounds, tree_.nodes.data(), range.pair, root, options_.bins,
                         std::max(options_.sah_depth - depth, 0)});
      return;
    }
    Sides sides;
    Chosen chosen = choose(range, references, bounds, depth, misses);
    if (!divide(range, references, bounds, chosen, references_[1 - array].data(), sides)) {
      chosen.misses = misses + 1;
    }
    write_node(tree_.nodes[root], bounds, range.pair, range.count);
    const auto lower = [&] {
      build(sides.lower, 2 * range.pair, sides.lower_bounds, 1 - array, depth + 1, chosen.misses);
    };
    const auto upper = [&] {
      build(sides.upper, 2 * range.pair + 1, sides.upper_bounds, 1 - array, depth + 1,
            chosen.misses);
    };
    if (range.count <= kSubtree) {
      lower();
      upper();
    } else {
      tbb::parallel_invoke(lower, upper);
    }
  }

  Chosen choose(const Range& range, const Reference* references, const Bounds8& bounds, int depth,
                int misses) const {
    Chosen chosen;
    chosen.misses = misses;
    if (depth >= options_.sah_depth || range.count < 2) return chosen;
    const Binning binning(bounds, options_.bins);
    chosen.object = splitter_.best(object_bins(references, range.count, binning), binning.bins);
    if (misses >= options_.spatial_misses || simple(range, bounds)) return chosen;
    if (chosen.object.axis >= 0 &&
        (chosen.object.overlap <= options_.least_overlap * root_area_ ||
         chosen.object.overlap <= options_.least_own_overlap * bounds.half_area())) {
      return chosen;
    }
    const SpatialBinning space(bounds, options_.spatial_bins);
    const SpatialSplit spatial =
        best(spatial_bins(references, range.count, space), space, range.room);
    chosen.misses = spatial.cost < chosen.object.cost ? 0 : misses + 1;
    if (chosen.misses == 0) chosen.spatial = spatial;
    return chosen;
  }

  ObjectBins object_bins(const Reference* references, std::uint32_t count,
                         const Binning& binning) const {
    ObjectBins bins;
    bins.clear(binning.bins);
    if (count <= 2 * kBlock) {
      splitter_.fill(references, count, binning, bins);
      return bins;
    }
    return tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, count, 4 * kBlock), bins,
        [&](const auto& r, ObjectBins sum) {
          splitter_.fill(references + r.begin(), r.size(), binning, sum);
          return sum;
        },
        [&](ObjectBins a, const ObjectBins& b) {
          a.add(b, binning.bins);
          return a;
        });
  }

  SpatialBins spatial_bins(const Reference* references, std::uint32_t count,
                           const SpatialBinning& binning) const {
    if (count <= 2 * kBlock) {
      SpatialBins bins;
      fill(input_, references, count, binning, bins);
      return bins;
    }
    return tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, count, kBlock), SpatialBins(),
        [&](const auto& r, SpatialBins sum) {
          fill(input_, references + r.begin(), r.size(), binning, sum);
          return sum;
        },
        [&](SpatialBins a, const SpatialBins& b) {
          a.add(b, binning.bins);
          return a;
        });
  }

  static Side side_of(const Reference& reference, const SpatialSplit& split) {
    if (reference.upper(split.axis) <= split.plane) return kLower;
    if (reference.lower[split.axis] >= split.plane) return kUpper;
    return kBoth;
  }
  // Where a reference that is not cut goes.
  static Side nearer(const Reference& reference, const SpatialSplit& split) {
    return reference.centre2(split.axis) < 2.0f * split.plane ? kLower : kUpper;
  }

  // Room goes to the sides by their sizes.
  static void share_out(const Range& range, std::uint32_t lower_count, std::uint32_t upper_count,
                        Range& lower, Range& upper) {
    const std::uint32_t room = range.count + range.room - lower_count - upper_count;
    const auto lower_room =
        static_cast<std::uint32_t>(std::uint64_t{room} * lower_count / (lower_count + upper_count));
    // The first pair is the node's own children.
    lower = {range.first, lower_count, lower_room, range.pair + 1};
    upper = {range.first + lower_count + lower_room, upper_count, room - lower_room,
             range.pair + lower_count + lower_room};
  }

  struct Sides {
    Range lower, upper;
    Bounds8 lower_bounds, upper_bounds;
  };

  // Moves the references to their sides of `to`. False: not as was chosen, but without cuts.
  bool divide(const Range& range, Reference* from, const Bounds8& bounds, const Chosen& chosen,
              Reference* to, Sides& sides) const {
    const Binning binning(bounds, options_.bins);
    if (chosen.spatial.axis >= 0 && cut_all(range, from, chosen.spatial, to, sides)) {
      sides.lower_bounds = bounds_of(to + sides.lower.first, sides.lower.count);
      sides.upper_bounds = bounds_of(to + sides.upper.first, sides.upper.count);
      return true;
    }
    if (chosen.object.axis >= 0) {
      scatter(range, from, chosen.object, binning, to, sides);
    } else {
      const std::uint32_t half = split_by_rank(from, range.count, bounds);
      share_out(range, half, range.count - half, sides.lower, sides.upper);
      std::copy_n(from, half, to + sides.lower.first);
      std::copy_n(from + half, range.count - half, to + sides.upper.first);
      sides.lower_bounds = bounds_of(to + sides.lower.first, sides.lower.count);
      sides.upper_bounds = bounds_of(to + sides.upper.first, sides.upper.count);
    }
    return chosen.spatial.axis < 0;
  }

  struct Counts {
    std::uint32_t lower = 0, upper = 0;
  };

  // From how many each block sends to either side to where its first ones go; returns all.
  static Counts sum_up(std::vector<Counts>& counts) {
    Counts sum;
    for (Counts& c : counts) {
      const Counts own = c;
      c = sum;
      sum.lower += own.lower;
      sum.upper += own.upper;
    }
    return sum;
  }

  void scatter(const Range& range, const Reference* from, const ObjectSplit& split,
               const Binning& binning, Reference* to, Sides& sides) const {
    std::vector<Counts> counts(blocks_of(range.count));
    for_blocks(range.count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
      const std::uint32_t lower = splitter_.count_lower(from + first, count, binning, split);
      counts[block] = {lower, count - lower};
    });
    const Counts all = sum_up(counts);
    share_out(range, all.lower, all.upper, sides.lower, sides.upper);
    std::vector<Bounds8> bounds(2 * counts.size());
    for_blocks(range.count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
      Scatter work{from + first,
                   count,
                   to + sides.lower.first + counts[block].lower,
                   to + sides.upper.first + counts[block].upper,
                   {},
                   {}};
      splitter_.scatter(work, binning, split);
      bounds[2 * block] = work.lower;
      bounds[2 * block + 1] = work.upper;
    });
    for (std::size_t i = 0; i < bounds.size(); i += 2) {
      sides.lower_bounds = joined(sides.lower_bounds, bounds[i]);
      sides.upper_bounds = joined(sides.upper_bounds, bounds[i + 1]);
    }
  }

  // False: not enough room for the parts, or nothing gained.
  bool cut_all(const Range& range, const Reference* from, const SpatialSplit& split, Reference* to,
               Sides& sides) const {
    std::vector<Counts> counts(blocks_of(range.count));
    for_blocks(range.count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
      for (std::uint32_t i = first; i < first + count; ++i) {
        const Side side = place(from[i], split, nullptr, nullptr);
        counts[block].lower += (side & kLower) != 0;
        counts[block].upper += (side & kUpper) != 0;
      }
    });
    const Counts all = sum_up(counts);
    if (all.lower + all.upper > range.count + range.room || all.lower >= range.count ||
        all.upper >= range.count || all.lower == 0 || all.upper == 0) {
      return false;
    }
    share_out(range, all.lower, all.upper, sides.lower, sides.upper);
    for_blocks(range.count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
      Reference* low = to + sides.lower.first + counts[block].lower;
      Reference* high = to + sides.upper.first + counts[block].upper;
      for (std::uint32_t i = first; i < first + count; ++i) {
        Reference a = from[i], b = from[i];
        const Side side = place(from[i], split, &a, &b);
        if (side & kLower) *low++ = a;
        if (side & kUpper) *high++ = b;
      }
    });
    return true;
  }

  // The side of a reference, and its parts where it is cut and they are asked for.
  Side place(const Reference& reference, const SpatialSplit& split, Reference* lower,
             Reference* upper) const {
    const Side side = side_of(reference, split);
    if (side != kBoth) return side;
    Reference a, b;
    if (!cut(input_, reference, split.axis, split.plane, &a, &b)) return nearer(reference, split);
    if (lower != nullptr) {
      *lower = a;
      *upper = b;
    }
    return kBoth;
  }

  const BuildInput& input_;
  const BinaryOptions options_;
  const ObjectSplitter splitter_;
  util::HugeVector<Reference> references_[2];
  BinaryTree tree_;
  float root_area_ = 0.0f;
};

}  // namespace

BinaryTree build_binary(const BuildInput& input, const BinaryOptions& options) {
  return BinaryBuilder(input, options).run();
}

}  // namespace octrace::octree
