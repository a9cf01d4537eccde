#include "backend/octree/object_split.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/object_split.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "backend/octree/clusters-inl.h"
#include "backend/octree/object_bins-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

HWY_ATTR Bounds8 bounds(const Reference* references, std::uint32_t count) {
  return bounds_of(references, count);
}

HWY_ATTR void fill(const Reference* references, std::uint32_t count, const Binning& binning,
                   ObjectBins& bins) {
  fill_bins(references, count, binning, bins, bins);
}

HWY_ATTR ObjectSplit best(const ObjectBins& bins, int count) {
  ObjectSplit split = best_split(bins, count);
  if (split.axis < 0) return split;
  Box8 lower = infinities(), upper = infinities();
  for (int bin = 0; bin < count; ++bin) {
    Box8& side = bin < split.bin ? lower : upper;
    side = lesser(side, load(bins.boxes[split.axis][bin]));
  }
  alignas(32) float a[8], b[8];
  store(lower, a);
  store(upper, b);
  float shared[3];
  for (int axis = 0; axis < 3; ++axis) {
    shared[axis] = std::min(-a[4 + axis], -b[4 + axis]) - std::max(a[axis], b[axis]);
    if (shared[axis] < 0.0f) return split;
  }
  const int axis = split.axis;
  split.overlap = shared[axis] * (shared[(axis + 1) % 3] + shared[(axis + 2) % 3]);
  return split;
}

HWY_ATTR std::uint32_t count_lower(const Reference* references, std::uint32_t count,
                                   const Binning& binning, const ObjectSplit& split) {
  const SidePlane plane(binning, split);
  std::uint32_t lower = 0;
  for (std::uint32_t i = 0; i < count; ++i)
    lower += plane.position(references[i]) < plane.first_upper;
  return lower;
}

HWY_ATTR void scatter(Scatter& work, const Binning& binning, const ObjectSplit& split) {
  const SidePlane plane(binning, split);
  TwoBounds bounds;
  Reference *low = work.low, *high = work.high;
  for (std::uint32_t i = 0; i < work.count; ++i) {
    const Box8 box = load(work.from[i]);
    const float position = plane.position(work.from[i]);
    const bool lower_side = position < plane.first_upper;
    store(box, (lower_side ? low : high)->lower);
    low += lower_side;
    high += !lower_side;
    bounds.add(box, position, plane.first_upper);
  }
  bounds.get(work.lower, work.upper);
}

class Subtree {
 public:
  explicit Subtree(const SubtreeRange& range) : range_(range) {}

  HWY_ATTR void run() { build(0, range_.count, range_.root, range_.bounds, 0); }

 private:
  // Bounded: below sah_depth levels every level halves the references.
  HWY_ATTR void build(std::uint32_t first, std::uint32_t last, std::uint32_t root,
                      const Bounds8& bounds, int depth) {
    const std::uint32_t count = last - first;
    BinaryNode& node = range_.nodes[root];
    if (count == 1) {
      write_node(node, bounds, BinaryNode::kLeaf | range_.references[first].triangle, 1);
      return;
    }
    if (count <= 8 && depth < range_.sah_depth) {
      const auto* references = range_.references + first;
      const auto build_few = count <= 4 ? Clusters<4>::build : Clusters<8>::build;
      build_few(references, count, range_.nodes, range_.first_pair + first, node);
      return;
    }
    Bounds8 lower, upper;
    const std::uint32_t middle =
        first + split(range_.references + first, count, bounds, depth, lower, upper);
    const std::uint32_t pair = range_.first_pair + middle - 1;
    write_node(node, bounds, pair, count);
    build(first, middle, 2 * pair, lower, depth + 1);
    build(middle, last, 2 * pair + 1, upper, depth + 1);
  }

  HWY_ATTR std::uint32_t split(Reference* references, std::uint32_t count, const Bounds8& bounds,
                               int depth, Bounds8& lower, Bounds8& upper) {
    if (depth < range_.sah_depth) {
      // Few bins tell few references apart.
      const Binning binning(bounds, count <= kFew ? 8 : range_.bins);
      clear(bins_, binning.bins);
      fill_bins(references, count, binning, bins_, bins_);
      const ObjectSplit chosen = best_split(bins_, binning.bins);
      if (chosen.axis >= 0) return partition(references, count, binning, chosen, lower, upper);
    }
    const std::uint32_t half = split_by_rank(references, count, bounds);
    lower = bounds_of(references, half);
    upper = bounds_of(references + half, count - half);
    return half;
  }

  // Stable and without branches on what falls where: those for the upper side wait aside.
  HWY_ATTR std::uint32_t partition(Reference* references, std::uint32_t count,
                                   const Binning& binning, const ObjectSplit& chosen,
                                   Bounds8& lower_bounds, Bounds8& upper_bounds) {
    const SidePlane plane(binning, chosen);
    TwoBounds bounds;
    std::uint32_t lower = 0, upper = 0;
    Reference* const spare = range_.spare;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Box8 box = load(references[i]);
      const float position = plane.position(references[i]);
      const bool lower_side = position < plane.first_upper;
      store(box, spare[upper].lower);
      store(box, references[lower].lower);
      lower += lower_side;
      upper += !lower_side;
      bounds.add(box, position, plane.first_upper);
    }
    std::memcpy(references + lower, spare, upper * sizeof(Reference));
    bounds.get(lower_bounds, upper_bounds);
    return lower;
  }

  static constexpr std::uint32_t kFew = 96;

  const SubtreeRange& range_;
  ObjectBins bins_;
};

HWY_ATTR void subtree(const SubtreeRange& range) { Subtree(range).run(); }

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::octree {

HWY_EXPORT(bounds);
HWY_EXPORT(fill);
HWY_EXPORT(best);
HWY_EXPORT(count_lower);
HWY_EXPORT(scatter);
HWY_EXPORT(subtree);

ObjectSplitter::ObjectSplitter() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  bounds = HWY_DISPATCH_TABLE(bounds)[index];
  fill = HWY_DISPATCH_TABLE(fill)[index];
  best = HWY_DISPATCH_TABLE(best)[index];
  count_lower = HWY_DISPATCH_TABLE(count_lower)[index];
  scatter = HWY_DISPATCH_TABLE(scatter)[index];
  subtree = HWY_DISPATCH_TABLE(subtree)[index];
}

int Binning::bin(float centre2, int axis) const {
  const float position = (centre2 - lower[axis]) * scale[axis];
  return std::min(static_cast<int>(position), bins - 1);
}

void ObjectBins::clear(int bins) {
  for (int axis = 0; axis < 3; ++axis) {
    std::fill_n(boxes[axis][0], 8 * bins, std::numeric_limits<float>::infinity());
    std::fill_n(counts[axis], bins, 0u);
  }
}

void ObjectBins::add(const ObjectBins& other, int bins) {
  for (int axis = 0; axis < 3; ++axis) {
    for (int bin = 0; bin < bins; ++bin) {
      for (int i = 0; i < 8; ++i) {
        boxes[axis][bin][i] = std::min(boxes[axis][bin][i], other.boxes[axis][bin][i]);
      }
      counts[axis][bin] += other.counts[axis][bin];
    }
  }
}

void write_node(BinaryNode& node, const Bounds8& bounds, std::uint32_t child, std::uint32_t count) {
  for (int axis = 0; axis < 3; ++axis) {
    node.lower[axis] = bounds.lower(axis);
    node.upper[axis] = bounds.upper(axis);
  }
  node.child = child;
  node.plan = count;
}

}  // namespace octrace::octree
#endif