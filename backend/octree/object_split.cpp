#include "backend/octree/object_split.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/object_split.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "backend/octree/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, 4> kHalfTag;

// A box: lower corner in words 0 to 2, negated upper corner in words 4 to 6.
using Box8 = Eight;

// Words 4 to 7 before words 0 to 3.
HWY_ATTR HWY_INLINE Box8 swapped(const Box8& a) {
  Box8 v;
#if HWY_MAX_BYTES >= 32 && HWY_TARGET != HWY_SCALAR
  v.part[0] = hn::ConcatLowerUpper(kTag, a.part[0], a.part[0]);
#else
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = a.part[(i + kParts / 2) % kParts];
#endif
  return v;
}
// Twice the centre in words 0 to 2, its negative in words 4 to 6.
HWY_ATTR HWY_INLINE Box8 centre(const Box8& a) {
  const Box8 other = swapped(a);
  Box8 v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Sub(a.part[i], other.part[i]);
  return v;
}
HWY_ATTR HWY_INLINE float half_area(const Box8& a) {
  alignas(32) float v[8];
  store(a, v);
  const float x = -v[4] - v[0], y = -v[5] - v[1], z = -v[6] - v[2];
  return x * y + y * z + z * x;
}

HWY_ATTR HWY_INLINE Box8 load(const Reference& reference) { return load(reference.lower); }

HWY_ATTR HWY_INLINE void bounds_of(const Reference* references, std::uint32_t count,
                                   Bounds8& bounds) {
  Box8 box = infinities(), centres = infinities();
  for (std::uint32_t i = 0; i < count; ++i) {
    const Box8 v = load(references[i]);
    box = lesser(box, v);
    centres = lesser(centres, centre(v));
  }
  store(box, bounds.box);
  store(centres, bounds.centres);
}

HWY_ATTR Bounds8 bounds(const Reference* references, std::uint32_t count) {
  Bounds8 result;
  bounds_of(references, count, result);
  return result;
}

// The bins of a few references first and then the boxes, so that the processor knows all addresses
// by the time it loads from them: references of one bin often follow each other.
HWY_ATTR HWY_INLINE void fill_bins(const Reference* references, std::uint32_t count,
                                   const Binning& binning, ObjectBins& bins) {
  constexpr std::uint32_t kFew = 32;
  alignas(16) std::int32_t bin[kFew][4];
#if HWY_TARGET != HWY_SCALAR
  const hn::RebindToSigned<decltype(kHalfTag)> di;
  const auto low = hn::LoadU(kHalfTag, binning.lower);
  const auto scale = hn::LoadU(kHalfTag, binning.scale);
  const auto most = hn::Set(di, binning.bins - 1);
#endif
  for (std::uint32_t first = 0; first < count; first += kFew) {
    const Reference* from = references + first;
    const std::uint32_t few = std::min(kFew, count - first);
    for (std::uint32_t i = 0; i < few; ++i) {
#if HWY_TARGET != HWY_SCALAR
      const auto lower = hn::Load(kHalfTag, from[i].lower);
      const auto upper = hn::Load(kHalfTag, from[i].negated_upper);
      const auto position = hn::Mul(hn::Sub(hn::Sub(lower, upper), low), scale);
      hn::Store(hn::Min(hn::ConvertTo(di, position), most), di, bin[i]);
#else
      for (int axis = 0; axis < 3; ++axis) bin[i][axis] = binning.bin(from[i], axis);
#endif
    }
    for (std::uint32_t i = 0; i < few; ++i) {
      const Box8 box = load(from[i]);
      for (int axis = 0; axis < 3; ++axis) {
        float* to = bins.boxes[axis][bin[i][axis]];
        store(lesser(load(to), box), to);
        ++bins.counts[axis][bin[i][axis]];
      }
    }
  }
}

HWY_ATTR void fill(const Reference* references, std::uint32_t count, const Binning& binning,
                   ObjectBins& bins) {
  fill_bins(references, count, binning, bins);
}

// Without branches on which bins are empty: the surface of nothing is infinite, times no references
// that is no number, which is not less than any cost.
HWY_ATTR HWY_INLINE ObjectSplit best_split(const ObjectBins& bins, int count) {
  constexpr auto kInfinity = std::numeric_limits<float>::infinity();
  Vector least = hn::Set(kTag, kInfinity), where = hn::Set(kTag, kInfinity);
  for (int axis = 0; axis < 3; ++axis) {
    alignas(32) float lower_cost[kMaxBins], upper_cost[kMaxBins];
    lower_cost[0] = upper_cost[0] = kInfinity;
    Box8 lower = infinities(), upper = infinities();
    std::uint32_t below = 0, above = 0;
    for (int bin = 1; bin < count; ++bin) {
      lower = lesser(lower, load(bins.boxes[axis][bin - 1]));
      below += bins.counts[axis][bin - 1];
      lower_cost[bin] = half_area(lower) * static_cast<float>(static_cast<std::int32_t>(below));
      upper = lesser(upper, load(bins.boxes[axis][count - bin]));
      above += bins.counts[axis][count - bin];
      upper_cost[count - bin] =
          half_area(upper) * static_cast<float>(static_cast<std::int32_t>(above));
    }
    for (int bin = 0; bin < count; bin += static_cast<int>(kLanes)) {
      const auto cost = hn::Add(hn::Load(kTag, lower_cost + bin), hn::Load(kTag, upper_cost + bin));
      const auto better = hn::Lt(cost, least);
      least = hn::IfThenElse(better, cost, least);
      where =
          hn::IfThenElse(better, hn::Iota(kTag, static_cast<float>(axis * kMaxBins + bin)), where);
    }
  }
  const auto cost = hn::MinOfLanes(kTag, least);
  const auto first =
      hn::MinOfLanes(kTag, hn::IfThenElse(hn::Eq(least, cost), where, hn::Set(kTag, kInfinity)));
  ObjectSplit split;
  split.cost = hn::GetLane(cost);
  // Some instruction sets' least of infinities is the largest number.
  if (split.cost < std::numeric_limits<float>::max()) {
    const auto at = static_cast<int>(hn::GetLane(first));
    split.axis = at / kMaxBins;
    split.bin = at % kMaxBins;
  }
  return split;
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
  split.overlap = shared[0] * shared[1] + shared[1] * shared[2] + shared[2] * shared[0];
  return split;
}

// Whether a reference goes to the lower side. A bin is a position without its fraction, and the
// first bin of the upper side is a whole number, so the fractions make no difference.
struct Plane {
  int axis;
  float low, scale, first_upper;

  Plane(const Binning& binning, const ObjectSplit& split)
      : axis(split.axis),
        low(binning.lower[axis]),
        scale(binning.scale[axis]),
        first_upper(static_cast<float>(split.bin)) {}
  float position(const Reference& reference) const {
    return (reference.centre2(axis) - low) * scale;
  }
};

// The bounds of both sides, gathered without branches on the side.
struct TwoBounds {
  Box8 box[2], centres[2];

  HWY_ATTR HWY_INLINE TwoBounds() {
    for (int side = 0; side < 2; ++side) box[side] = centres[side] = infinities();
  }

  // The comparison is made once more here: of a bool, compilers make a branch.
  HWY_ATTR HWY_INLINE void add(const Box8& v, float position, float first_upper) {
    const Box8 c = centre(v);
    const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
    const auto lower = hn::Lt(hn::Set(kTag, position), hn::Set(kTag, first_upper));
    for (std::size_t i = 0; i < kParts; ++i) {
      box[0].part[i] = hn::Min(box[0].part[i], hn::IfThenElse(lower, v.part[i], infinite));
      box[1].part[i] = hn::Min(box[1].part[i], hn::IfThenElse(lower, infinite, v.part[i]));
      centres[0].part[i] = hn::Min(centres[0].part[i], hn::IfThenElse(lower, c.part[i], infinite));
      centres[1].part[i] = hn::Min(centres[1].part[i], hn::IfThenElse(lower, infinite, c.part[i]));
    }
  }
  HWY_ATTR HWY_INLINE void get(Bounds8& lower, Bounds8& upper) const {
    store(box[0], lower.box);
    store(centres[0], lower.centres);
    store(box[1], upper.box);
    store(centres[1], upper.centres);
  }
};

HWY_ATTR std::uint32_t count_lower(const Reference* references, std::uint32_t count,
                                   const Binning& binning, const ObjectSplit& split) {
  const Plane plane(binning, split);
  std::uint32_t lower = 0;
  for (std::uint32_t i = 0; i < count; ++i)
    lower += plane.position(references[i]) < plane.first_upper;
  return lower;
}

HWY_ATTR void scatter(Scatter& work, const Binning& binning, const ObjectSplit& split) {
  const Plane plane(binning, split);
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

// Eight numbers, one a cluster.
using Row8 = Eight;

// Joins up to kRows references, the pair of the least surface first (Walter et al. 2008, "Fast
// agglomerative clustering for rendering"): for so few that is faster than splitting them from
// above, and the trees are as good. No loop depends on the count, which nothing could predict;
// nothing is stored by parts and loaded whole, which would wait for the stores.
template <int kRows>
class Clusters {
 public:
  // The clusters' pairs of nodes are those from first_pair on.
  HWY_ATTR static void build(const Reference* references, std::uint32_t count, BinaryNode* nodes,
                             std::uint32_t first_pair, BinaryNode& root) {
    Clusters clusters(references, count);
    for (std::uint32_t i = 0; i + 2 < count; ++i) clusters.join_nearest(nodes, first_pair + i);
    const std::uint32_t last = clusters.next();
    clusters.write(nodes, first_pair + count - 2, 0, last);
    clusters.merge(0, last, first_pair + count - 2);
    clusters.write(root, 0);
  }

 private:
  HWY_ATTR Clusters(const Reference* references, std::uint32_t count) {
    for (auto& corners : corners_) store(infinities(), corners);
    for (std::uint32_t i = 0; i < kRows; ++i) {
      const Reference& reference = references[std::min(i, count - 1)];
      for (int axis = 0; axis < 3; ++axis) {
        corners_[axis][i] = reference.lower[axis];
        corners_[3 + axis][i] = reference.negated_upper[axis];
      }
      child_[i] = BinaryNode::kLeaf | reference.triangle;
      references_[i] = 1;
    }
    const auto number = hn::Set(kTag, static_cast<float>(count));
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto slot = hn::Iota(kTag, static_cast<float>(part * kLanes));
      hn::Store(hn::IfThenElseZero(hn::Lt(slot, number), hn::Set(kTag, 1.0f)), kTag,
                alive_ + part * kLanes);
    }
    for (std::uint32_t i = 0; i < kRows; ++i) {
      store(i < count ? costs_of(i) : infinities(), cost_[i]);
    }
  }

  // The surface of the cluster joined with each other one; infinite where there is none.
  HWY_ATTR HWY_INLINE Row8 costs_of(std::uint32_t i) const {
    Row8 costs;
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t at = part * kLanes;
      Vector extent[3];
      for (int axis = 0; axis < 3; ++axis) {
        const auto lower =
            hn::Min(hn::Load(kTag, corners_[axis] + at), hn::Set(kTag, corners_[axis][i]));
        const auto upper =
            hn::Min(hn::Load(kTag, corners_[3 + axis] + at), hn::Set(kTag, corners_[3 + axis][i]));
        extent[axis] = hn::Sub(hn::Neg(upper), lower);
      }
      const auto area =
          hn::Add(hn::Add(hn::Mul(extent[0], extent[1]), hn::Mul(extent[1], extent[2])),
                  hn::Mul(extent[2], extent[0]));
      const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
      const auto self =
          hn::Eq(hn::Iota(kTag, static_cast<float>(at)), hn::Set(kTag, static_cast<float>(i)));
      const auto alive = hn::Gt(hn::Load(kTag, alive_ + at), hn::Zero(kTag));
      // No number is no less than infinity.
      const auto use = hn::And(hn::And(alive, hn::Lt(area, infinite)), hn::Not(self));
      costs.part[part] = hn::IfThenElse(use, area, infinite);
    }
    return costs;
  }

  HWY_ATTR HWY_INLINE void join_nearest(BinaryNode* nodes, std::uint32_t pair) {
    Row8 least = load(cost_[0]);
    for (std::uint32_t i = 1; i < kRows; ++i) least = lesser(least, load(cost_[i]));
    const Vector value = least_of(least);
    std::uint32_t a = 0, b = 0;
    if (hn::GetLane(value) < std::numeric_limits<float>::infinity()) {
      a = first_of(least, value);  // the costs are symmetric
      b = first_of(load(cost_[a]), value);
    } else {
      b = next();
    }
    write(nodes, pair, a, b);
    merge(a, b, pair);
    update(a, b);
  }
  // The first one after cluster 0, which always lives.
  std::uint32_t next() const {
    std::uint32_t i = 1;
    while (alive_[i] == 0.0f) ++i;
    return i;
  }

  void write(BinaryNode& node, std::uint32_t i) const {
    for (int axis = 0; axis < 3; ++axis) {
      node.lower[axis] = corners_[axis][i];
      node.upper[axis] = -corners_[3 + axis][i];
    }
    node.child = child_[i];
    node.plan = references_[i];
  }
  void write(BinaryNode* nodes, std::uint32_t pair, std::uint32_t a, std::uint32_t b) const {
    write(nodes[2 * pair], a);
    write(nodes[2 * pair + 1], b);
  }

  // b, which is after a, becomes part of a.
  HWY_ATTR HWY_INLINE void merge(std::uint32_t a, std::uint32_t b, std::uint32_t pair) {
    child_[a] = pair;
    references_[a] += references_[b];
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t at = part * kLanes;
      const auto slot = hn::Iota(kTag, static_cast<float>(at));
      const auto is_a = hn::Eq(slot, hn::Set(kTag, static_cast<float>(a)));
      const auto is_b = hn::Eq(slot, hn::Set(kTag, static_cast<float>(b)));
      for (auto& corners : corners_) {
        const auto row = hn::Load(kTag, corners + at);
        const auto joined = hn::Min(row, hn::Set(kTag, corners[b]));
        hn::Store(hn::IfThenElse(is_a, joined, row), kTag, corners + at);
      }
      const auto alive = hn::Load(kTag, alive_ + at);
      hn::Store(hn::IfThenZeroElse(is_b, alive), kTag, alive_ + at);
    }
  }

  HWY_ATTR HWY_INLINE void update(std::uint32_t a, std::uint32_t b) {
    store(costs_of(a), cost_[a]);
    store(infinities(), cost_[b]);
    const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto slot = hn::Iota(kTag, static_cast<float>(part * kLanes));
      const auto is_a = hn::Eq(slot, hn::Set(kTag, static_cast<float>(a)));
      const auto is_b = hn::Eq(slot, hn::Set(kTag, static_cast<float>(b)));
      for (std::uint32_t i = 0; i < kRows; ++i) {
        float* at = cost_[i] + part * kLanes;
        const auto with_a = hn::IfThenElse(is_a, hn::Set(kTag, cost_[a][i]), hn::Load(kTag, at));
        hn::Store(hn::IfThenElse(is_b, infinite, with_a), kTag, at);
      }
    }
  }

  alignas(32) float corners_[6][8];  // lower, negated upper
  alignas(32) float cost_[kRows][8];
  alignas(32) float alive_[8];
  std::uint32_t child_[kRows];
  std::uint32_t references_[kRows];
};

class Subtree {
 public:
  explicit Subtree(const SubtreeRange& range) : range_(range) {}

  HWY_ATTR void run() {
    Bounds8 bounds;
    bounds_of(range_.references, range_.count, bounds);
    build(0, range_.count, range_.root, bounds, 0);
  }

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
      const Binning binning(bounds, count <= 32 ? 8 : range_.bins);
      bins_.clear(binning.bins);
      fill_bins(references, count, binning, bins_);
      const ObjectSplit chosen = best_split(bins_, binning.bins);
      if (chosen.axis >= 0) return partition(references, count, binning, chosen, lower, upper);
    }
    const std::uint32_t half = split_by_rank(references, count, bounds);
    bounds_of(references, half, lower);
    bounds_of(references + half, count - half, upper);
    return half;
  }

  // Stable and without branches on what falls where: those for the upper side wait in spare_.
  HWY_ATTR std::uint32_t partition(Reference* references, std::uint32_t count,
                                   const Binning& binning, const ObjectSplit& chosen,
                                   Bounds8& lower_bounds, Bounds8& upper_bounds) {
    const Plane plane(binning, chosen);
    TwoBounds bounds;
    std::uint32_t lower = 0, upper = 0;
    if (spare_ == nullptr) spare_ = std::make_unique_for_overwrite<Reference[]>(range_.count);
    Reference* const spare = spare_.get();
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

  const SubtreeRange& range_;
  ObjectBins bins_;
  std::unique_ptr<Reference[]> spare_;
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

Binning::Binning(const Bounds8& bounds, int bin_count) : bins(bin_count) {
  for (int axis = 0; axis < 3; ++axis) {
    lower[axis] = bounds.centres[axis];
    const float extent = -bounds.centres[4 + axis] - lower[axis];
    scale[axis] = extent > 0.0f ? static_cast<float>(bins) * 0.9999f / extent : 0.0f;
    // A denormal extent overflows the quotient; such an axis cannot be told apart.
    if (!(scale[axis] < std::numeric_limits<float>::max())) scale[axis] = 0.0f;
  }
  lower[3] = scale[3] = 0.0f;
}

int Binning::bin(const Reference& reference, int axis) const {
  const float position = (reference.centre2(axis) - lower[axis]) * scale[axis];
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

std::uint32_t split_by_rank(Reference* references, std::uint32_t count, const Bounds8& bounds) {
  float extent[3];
  for (int axis = 0; axis < 3; ++axis) {
    extent[axis] = -bounds.centres[4 + axis] - bounds.centres[axis];
  }
  int axis = extent[1] > extent[0] ? 1 : 0;
  if (extent[2] > extent[axis]) axis = 2;
  const std::uint32_t half = count / 2;
  // Parts of one triangle at the same place are alike in all that matters.
  std::nth_element(references, references + half, references + count,
                   [axis](const Reference& a, const Reference& b) {
                     const float ca = a.centre2(axis), cb = b.centre2(axis);
                     return ca < cb || (ca == cb && a.triangle < b.triangle);
                   });
  return half;
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
