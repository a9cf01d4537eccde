// The upper part of the tree is split here, by all threads and from one array of references into
// another, with room for the parts that spatial splits make; subtrees of few references without
// spatial splits are left to one thread each (object_split.cpp).
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
#include "backend/octree/spatial_split.h"

namespace octrace::octree {

namespace {

constexpr std::uint32_t kSubtree = 4096;  // references that one thread takes at once
constexpr std::uint32_t kBlock = 4096;
constexpr std::uint32_t kLeastSpatial = 32;  // references worth a spatial split

// References [first, first + count) of an array, with room for `room` more after them. The range
// owns the pairs [pair, pair + count + room - 1).
struct Range {
  std::uint32_t first, count, room, pair;
};

struct Chosen {
  ObjectSplit object;
  SpatialSplit spatial;
  bool by_rank() const { return object.axis < 0 && spatial.axis < 0; }
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
    references_[0] = std::make_unique_for_overwrite<Reference[]>(most);
    if (count > kSubtree || room > 0) {
      references_[1] = std::make_unique_for_overwrite<Reference[]>(most);
    }
    tree_.size = 2 * most;
    tree_.nodes = std::make_unique_for_overwrite<BinaryNode[]>(tree_.size);
    tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count, kBlock), [&](const auto& r) {
      for (std::uint32_t i = r.begin(); i < r.end(); ++i) {
        const Box box = triangle_box(input_, i);
        references_[0][i] = {{box.lower[0], box.lower[1], box.lower[2]},
                             i,
                             {-box.upper[0], -box.upper[1], -box.upper[2]},
                             0};
      }
    });
    const Bounds8 bounds = bounds_of(references_[0].get(), count);
    root_area_ = bounds.half_area();
    build({0, count, room, 1}, BinaryTree::kRoot, bounds, 0, 0);
    return std::move(tree_);
  }

 private:
  Bounds8 bounds_of(const Reference* references, std::uint32_t count) const {
    if (count <= 2 * kBlock) return splitter_.bounds(references, count);
    return tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, count, kBlock), Bounds8(),
        [&](const auto& r, const Bounds8& sum) {
          return joined(sum, splitter_.bounds(references + r.begin(), r.size()));
        },
        joined);
  }
  static Bounds8 joined(Bounds8 a, const Bounds8& b) {
    for (int i = 0; i < 8; ++i) {
      a.box[i] = std::min(a.box[i], b.box[i]);
      a.centres[i] = std::min(a.centres[i], b.centres[i]);
    }
    return a;
  }

  // A subtree that no spatial split can help: neither it nor anything below it is large enough.
  bool simple(const Range& range, const Bounds8& bounds) const {
    return range.room == 0 || range.count < kLeastSpatial ||
           !(bounds.half_area() > options_.least_overlap * root_area_);
  }

  // `array`: which of the two holds the references.
  void build(const Range& range, std::uint32_t root, const Bounds8& bounds, int array, int depth) {
    Reference* references = references_[array].get() + range.first;
    if (range.count <= kSubtree && simple(range, bounds)) {
      splitter_.subtree({references, range.count, tree_.nodes.get(), range.pair, root,
                         options_.bins, std::max(options_.sah_depth - depth, 0)});
      return;
    }
    const Chosen chosen = choose(range, references, bounds, depth);
    Range lower, upper;
    if (chosen.by_rank()) {
      const std::uint32_t half = split_by_rank(references, range.count, bounds);
      share_out(range, half, range.count - half, lower, upper);
      Reference* to = references_[1 - array].get();
      std::copy_n(references, half, to + lower.first);
      std::copy_n(references + half, range.count - half, to + upper.first);
    } else {
      scatter(range, references, bounds, chosen, references_[1 - array].get(), lower, upper);
    }
    write_node(tree_.nodes[root], bounds, range.pair, range.count);
    const auto descend = [&](const Range& side, std::uint32_t index) {
      const Reference* moved = references_[1 - array].get() + side.first;
      build(side, index, bounds_of(moved, side.count), 1 - array, depth + 1);
    };
    if (range.count <= kSubtree) {
      descend(lower, 2 * range.pair);
      descend(upper, 2 * range.pair + 1);
    } else {
      tbb::parallel_invoke([&] { descend(lower, 2 * range.pair); },
                           [&] { descend(upper, 2 * range.pair + 1); });
    }
  }

  Chosen choose(const Range& range, const Reference* references, const Bounds8& bounds,
                int depth) const {
    Chosen chosen;
    if (depth >= options_.sah_depth || range.count < 2) return chosen;
    const Binning binning(bounds, options_.bins);
    chosen.object = splitter_.best(object_bins(references, range.count, binning), binning.bins);
    if (simple(range, bounds)) return chosen;
    if (chosen.object.axis >= 0 &&
        (chosen.object.overlap <= options_.least_overlap * root_area_ ||
         chosen.object.overlap <= options_.least_own_overlap * bounds.half_area())) {
      return chosen;
    }
    const SpatialBinning space(bounds, options_.spatial_bins);
    const SpatialSplit spatial = best(spatial_bins(references, range.count, space), space);
    if (spatial.cost < chosen.object.cost) chosen.spatial = spatial;
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

  static Side side_of(const Reference& reference, const Chosen& chosen, const Binning& binning) {
    if (chosen.spatial.axis < 0) {
      const int bin = binning.bin(reference, chosen.object.axis);
      return bin < chosen.object.bin ? kLower : kUpper;
    }
    const int axis = chosen.spatial.axis;
    if (reference.upper(axis) <= chosen.spatial.plane) return kLower;
    if (reference.lower[axis] >= chosen.spatial.plane) return kUpper;
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

  struct Counts {
    std::uint32_t lower = 0, upper = 0;
  };

  void scatter(const Range& range, const Reference* from, const Bounds8& bounds,
               const Chosen& wanted, Reference* to, Range& lower, Range& upper) const {
    Chosen chosen = wanted;
    const Binning binning(bounds, options_.bins);
    const std::uint32_t blocks = (range.count + kBlock - 1) / kBlock;
    std::vector<Counts> counts(blocks);
    const auto for_blocks = [&](const auto& body) {
      if (blocks == 1) {
        body(0u);
      } else {
        tbb::parallel_for(0u, blocks, body);
      }
    };
    const auto count_all = [&] {
      for_blocks([&](std::uint32_t block) {
        Counts sum;
        const std::uint32_t end = std::min((block + 1) * kBlock, range.count);
        for (std::uint32_t i = block * kBlock; i < end; ++i) {
          const Side side = place(from[i], chosen, binning, nullptr, nullptr);
          sum.lower += (side & kLower) != 0;
          sum.upper += (side & kUpper) != 0;
        }
        counts[block] = sum;
      });
      Counts all;
      for (const Counts& c : counts) {
        all.lower += c.lower;
        all.upper += c.upper;
      }
      return all;
    };
    Counts all = count_all();
    if (chosen.spatial.axis >= 0 &&
        (all.lower + all.upper > range.count + range.room || all.lower >= range.count ||
         all.upper >= range.count || all.lower == 0 || all.upper == 0)) {
      // Not enough room, or nothing gained: fall back on the object split.
      chosen.spatial.axis = -1;
      if (chosen.object.axis >= 0) all = count_all();
    }
    if (chosen.by_rank()) {
      all = {range.count / 2, range.count - range.count / 2};
      share_out(range, all.lower, all.upper, lower, upper);
      std::copy_n(from, all.lower, to + lower.first);
      std::copy_n(from + all.lower, all.upper, to + upper.first);
      return;
    }
    share_out(range, all.lower, all.upper, lower, upper);
    Counts sum;
    for (Counts& c : counts) {
      const Counts own = c;
      c = sum;
      sum.lower += own.lower;
      sum.upper += own.upper;
    }
    for_blocks([&](std::uint32_t block) {
      Reference* low = to + lower.first + counts[block].lower;
      Reference* high = to + upper.first + counts[block].upper;
      const std::uint32_t end = std::min((block + 1) * kBlock, range.count);
      for (std::uint32_t i = block * kBlock; i < end; ++i) {
        Reference a = from[i], b = from[i];
        const Side side = place(from[i], chosen, binning, &a, &b);
        if (side & kLower) *low++ = a;
        if (side & kUpper) *high++ = b;
      }
    });
  }

  // The side of a reference, and its parts where it is cut and they are asked for.
  Side place(const Reference& reference, const Chosen& chosen, const Binning& binning,
             Reference* lower, Reference* upper) const {
    const Side side = side_of(reference, chosen, binning);
    if (side != kBoth) return side;
    Reference a, b;
    if (!cut(input_, reference, chosen.spatial.axis, chosen.spatial.plane, &a, &b)) {
      return nearer(reference, chosen.spatial);
    }
    if (lower != nullptr) {
      *lower = a;
      *upper = b;
    }
    return kBoth;
  }

  const BuildInput& input_;
  const BinaryOptions options_;
  const ObjectSplitter splitter_;
  std::unique_ptr<Reference[]> references_[2];
  BinaryTree tree_;
  float root_area_ = 0.0f;
};

}  // namespace

BinaryTree build_binary(const BuildInput& input, const BinaryOptions& options) {
  return BinaryBuilder(input, options).run();
}

}  // namespace octrace::octree
