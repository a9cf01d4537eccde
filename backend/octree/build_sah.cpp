// Eight-way nodes whose planes the surface-area heuristic chooses: binned splits (Wald 2007, "On
// fast construction of SAH-based bounding volume hierarchies") of the child with the largest
// surface, until a node has eight children.
//
// Deterministic for any number of threads: bins are filled by minima, maxima and integer counts,
// which do not depend on order, and each range is partitioned by one thread.
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <bit>

#include "backend/octree/builders.h"

namespace octrace::octree {

namespace {

constexpr int kBins = 16;
constexpr std::uint32_t kParallelTriangles = 4096;
// From this depth on nodes split at the median. Rank splits divide by eight a level, so 2^31
// triangles need 11 levels more: below kMaxDepth.
constexpr std::uint32_t kMedianDepth = 20;

struct Reference {
  Float4 lower;  // lane 3: the triangle's index, as bits
  Float4 upper;

  Box box() const {
    Box result{lower, upper};
    result.lower[3] = 0.0f;
    return result;
  }
  Float4 centre2() const { return lower + upper; }
  std::uint32_t id() const { return std::bit_cast<std::uint32_t>(float{lower[3]}); }
};

struct Range {
  std::uint32_t first = 0, last = 0;
  Box box;      // of the triangles
  Box centres;  // of twice their centres
  std::uint32_t count() const { return last - first; }
};

struct Split {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;  // -1: none; split at the median instead
  int bin = 0;    // the first bin of the upper side
};

// Where a centre falls along each axis: (centre2 - lower) * scale, clamped into the bins.
struct Binning {
  Float4 lower, scale;

  explicit Binning(const Box& centres) : lower(centres.lower) {
    const Float4 extent = centres.upper - centres.lower;
    for (int axis = 0; axis < 3; ++axis) {
      scale[axis] = extent[axis] > 0.0f ? kBins * 0.9999f / extent[axis] : 0.0f;
      // A denormal extent overflows the quotient; such an axis cannot be told apart.
      if (!(scale[axis] < std::numeric_limits<float>::max())) scale[axis] = 0.0f;
    }
    scale[3] = 0.0f;
  }
  int bin(const Reference& reference, int axis) const {
    const float position = (reference.centre2()[axis] - lower[axis]) * scale[axis];
    return std::min(static_cast<int>(position), kBins - 1);
  }
};

struct Bins {
  Box boxes[3][kBins];
  std::uint32_t counts[3][kBins] = {};

  void add(const Binning& binning, const Reference& reference) {
    const Box box = reference.box();
    const Float4 position = (reference.centre2() - binning.lower) * binning.scale;
    for (int axis = 0; axis < 3; ++axis) {
      const int bin = std::min(static_cast<int>(position[axis]), kBins - 1);
      boxes[axis][bin].add(box);
      ++counts[axis][bin];
    }
  }
  void add(const Bins& other) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int bin = 0; bin < kBins; ++bin) {
        boxes[axis][bin].add(other.boxes[axis][bin]);
        counts[axis][bin] += other.counts[axis][bin];
      }
    }
  }

  Split best() const {
    Split best;
    for (int axis = 0; axis < 3; ++axis) {
      float upper_cost[kBins];
      Box box;
      std::uint32_t count = 0;
      for (int bin = kBins - 1; bin > 0; --bin) {
        box.add(boxes[axis][bin]);
        count += counts[axis][bin];
        upper_cost[bin] = count == 0 ? -1.0f : box.half_area() * static_cast<float>(count);
      }
      box = Box{};
      count = 0;
      for (int bin = 1; bin < kBins; ++bin) {
        box.add(boxes[axis][bin - 1]);
        count += counts[axis][bin - 1];
        if (count == 0 || upper_cost[bin] < 0.0f) continue;
        const float cost = box.half_area() * static_cast<float>(count) + upper_cost[bin];
        if (cost < best.cost) best = {cost, axis, bin};
      }
    }
    return best;
  }
};

class SahBuilder {
 public:
  SahBuilder(const BuildInput& input, std::uint32_t leaf, TreeArena& arena)
      : input_(input), leaf_(leaf), arena_(arena) {}

  TreeNode* build(std::vector<std::uint32_t>& ids) {
    if (input_.triangles.empty()) return nullptr;
    const Range all = make_references();
    TreeNode* root = make_node(all, 0);
    ids.resize(references_.size());
    tbb::parallel_for(std::size_t{0}, ids.size(),
                      [&](std::size_t i) { ids[i] = references_[i].id(); });
    return root;
  }

 private:
  Range make_references() {
    const auto count = static_cast<std::uint32_t>(input_.triangles.size());
    references_.resize(count);
    Range all;
    const auto bounds = tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, count, kParallelTriangles), Range{},
        [&](const tbb::blocked_range<std::uint32_t>& r, Range sum) {
          for (std::uint32_t i = r.begin(); i < r.end(); ++i) {
            const Box box = triangle_box(input_, i);
            Reference& reference = references_[i];
            reference = {box.lower, box.upper};
            sum.box.add(box);
            sum.centres.add(box.centre2());
            reference.lower[3] = std::bit_cast<float>(i);
          }
          return sum;
        },
        merge);
    all = bounds;
    all.first = 0;
    all.last = count;
    return all;
  }

  static Range merge(Range a, const Range& b) {
    a.box.add(b.box);
    a.centres.add(b.centres);
    return a;
  }

  void add_to(Range& range, const Reference& reference) {
    const Box box = reference.box();
    range.box.add(box);
    range.centres.add(box.centre2());
  }

  Split find_split(const Range& range) const {
    const Binning binning(range.centres);
    const auto fill = [&](std::uint32_t first, std::uint32_t last, Bins& bins) {
      for (std::uint32_t i = first; i < last; ++i) bins.add(binning, references_[i]);
    };
    if (range.count() < kParallelTriangles * 4) {
      Bins bins;
      fill(range.first, range.last, bins);
      return bins.best();
    }
    return tbb::parallel_reduce(
               tbb::blocked_range<std::uint32_t>(range.first, range.last, kParallelTriangles),
               Bins{},
               [&](const tbb::blocked_range<std::uint32_t>& r, Bins bins) {
                 fill(r.begin(), r.end(), bins);
                 return bins;
               },
               [](Bins a, const Bins& b) {
                 a.add(b);
                 return a;
               })
        .best();
  }

  std::pair<Range, Range> split(const Range& range, std::uint32_t depth) {
    const Split best = depth < kMedianDepth ? find_split(range) : Split{};
    return best.axis < 0 ? split_median(range) : partition(range, best);
  }

  std::pair<Range, Range> partition(const Range& range, const Split& split) {
    const Binning binning(range.centres);
    Range lower, upper;
    std::uint32_t i = range.first, j = range.last;
    while (i < j) {
      if (binning.bin(references_[i], split.axis) < split.bin) {
        add_to(lower, references_[i++]);
      } else {
        add_to(upper, references_[i]);
        std::swap(references_[i], references_[--j]);
      }
    }
    lower.first = range.first;
    lower.last = upper.first = i;
    upper.last = range.last;
    return {lower, upper};
  }

  // Halves by rank along the longest axis of the centres; the index decides among equals.
  std::pair<Range, Range> split_median(const Range& range) {
    const Float4 extent = range.centres.upper - range.centres.lower;
    int axis = extent[1] > extent[0] ? 1 : 0;
    if (extent[2] > extent[axis]) axis = 2;
    const std::uint32_t middle = range.first + range.count() / 2;
    const auto begin = references_.begin();
    std::nth_element(begin + range.first, begin + middle, begin + range.last,
                     [axis](const Reference& a, const Reference& b) {
                       const float ca = a.centre2()[axis], cb = b.centre2()[axis];
                       return ca < cb || (ca == cb && a.id() < b.id());
                     });
    Range lower, upper;
    lower.first = range.first;
    lower.last = upper.first = middle;
    upper.last = range.last;
    for (std::uint32_t i = lower.first; i < lower.last; ++i) add_to(lower, references_[i]);
    for (std::uint32_t i = upper.first; i < upper.last; ++i) add_to(upper, references_[i]);
    return {lower, upper};
  }

  // The child to split next: what is too large for a leaf first, then the largest surface.
  int choose(std::span<const Range> children, std::uint32_t depth) const {
    int best = -1;
    bool best_large = false;
    float best_key = -1.0f;
    for (std::size_t i = 0; i < children.size(); ++i) {
      if (children[i].count() < 2) continue;
      const bool large = children[i].count() > leaf_;
      const float key = depth < kMedianDepth ? children[i].box.half_area()
                                             : static_cast<float>(children[i].count());
      if (best < 0 || large > best_large || (large == best_large && key > best_key)) {
        best = static_cast<int>(i);
        best_large = large;
        best_key = key;
      }
    }
    return best;
  }

  TreeNode* make_node(const Range& range, std::uint32_t depth) {
    std::array<Range, kernels::kChildren> ranges;
    std::size_t count = 1;
    ranges[0] = range;
    while (count < kernels::kChildren) {
      const int chosen = choose({ranges.data(), count}, depth);
      if (chosen < 0) break;
      const auto [lower, upper] = split(ranges[chosen], depth);
      ranges[chosen] = lower;
      ranges[count++] = upper;
    }
    std::array<Child, kernels::kChildren> children;
    const auto make = [&](std::size_t i) {
      const Range& r = ranges[i];
      Child& child = children[i];
      child.box = r.box;
      if (r.count() > leaf_) {
        child.node = make_node(r, depth + 1);
      } else {
        child.leaf_first = r.first;
        child.leaf_count = r.count();
      }
    };
    if (range.count() < kParallelTriangles) {
      for (std::size_t i = 0; i < count; ++i) make(i);
    } else {
      tbb::parallel_for(std::size_t{0}, count, make);
    }
    TreeNode* node = arena_.allocate();
    const std::span<const Child> used(children.data(), count);
    encode(used, slots_by_octant(used, range.box), *node);
    return node;
  }

  const BuildInput& input_;
  const std::uint32_t leaf_;
  TreeArena& arena_;
  std::vector<Reference> references_;
};

}  // namespace

TreeNode* build_sah(const BuildInput& input, std::uint32_t leaf_triangles, TreeArena& arena,
                    std::vector<std::uint32_t>& ids) {
  return SahBuilder(input, leaf_triangles, arena).build(ids);
}

}  // namespace octrace::octree
