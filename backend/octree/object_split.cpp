#include "backend/octree/object_split.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/object_split.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, 8> kTag;
const hn::CappedTag<float, 4> kHalfTag;
using Vector = hn::Vec<decltype(kTag)>;
using HalfVector = hn::Vec<decltype(kHalfTag)>;
constexpr std::size_t kLanes = HWY_MIN(HWY_MAX_BYTES / sizeof(float), 8);
constexpr std::size_t kParts = 8 / kLanes;
constexpr std::size_t kHalfParts = HWY_MAX(kParts / 2, 1);

// A box: lower corner in words 0 to 2, negated upper corner in words 4 to 6.
struct Box8 {
  Vector part[kParts] = {};
};

HWY_ATTR HWY_INLINE Box8 load(const float* from) {
  Box8 v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Load(kTag, from + i * kLanes);
  return v;
}
HWY_ATTR HWY_INLINE void store(const Box8& v, float* to) {
  for (std::size_t i = 0; i < kParts; ++i) hn::Store(v.part[i], kTag, to + i * kLanes);
}
HWY_ATTR HWY_INLINE Box8 nothing() {
  Box8 v;
  for (auto& part : v.part) part = hn::Set(kTag, std::numeric_limits<float>::infinity());
  return v;
}
HWY_ATTR HWY_INLINE Box8 join(const Box8& a, const Box8& b) {
  Box8 v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Min(a.part[i], b.part[i]);
  return v;
}
// Words 4 to 7 before words 0 to 3.
HWY_ATTR HWY_INLINE Box8 swapped(const Box8& a) {
  Box8 v;
#if HWY_MAX_BYTES >= 32
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
  Box8 box = nothing(), centres = nothing();
  for (std::uint32_t i = 0; i < count; ++i) {
    const Box8 v = load(references[i]);
    box = join(box, v);
    centres = join(centres, centre(v));
  }
  store(box, bounds.box);
  store(centres, bounds.centres);
}

HWY_ATTR Bounds8 bounds(const Reference* references, std::uint32_t count) {
  Bounds8 result;
  bounds_of(references, count, result);
  return result;
}

HWY_ATTR HWY_INLINE void fill_bins(const Reference* references, std::uint32_t count,
                                   const Binning& binning, ObjectBins& bins) {
#if HWY_TARGET != HWY_SCALAR
  const hn::RebindToSigned<decltype(kHalfTag)> di;
  const auto low = hn::LoadU(kHalfTag, binning.lower);
  const auto scale = hn::LoadU(kHalfTag, binning.scale);
  const auto most = hn::Set(di, binning.bins - 1);
#endif
  for (std::uint32_t i = 0; i < count; ++i) {
    const Box8 box = load(references[i]);
    alignas(16) std::int32_t bin[4];
#if HWY_TARGET != HWY_SCALAR
    const auto lower = hn::Load(kHalfTag, references[i].lower);
    const auto upper = hn::Load(kHalfTag, references[i].negated_upper);
    const auto position = hn::Mul(hn::Sub(hn::Sub(lower, upper), low), scale);
    hn::Store(hn::Min(hn::ConvertTo(di, position), most), di, bin);
#else
    for (int axis = 0; axis < 3; ++axis) bin[axis] = binning.bin(references[i], axis);
#endif
    for (int axis = 0; axis < 3; ++axis) {
      float* to = bins.boxes[axis][bin[axis]];
      store(join(load(to), box), to);
      ++bins.counts[axis][bin[axis]];
    }
  }
}

HWY_ATTR void fill(const Reference* references, std::uint32_t count, const Binning& binning,
                   ObjectBins& bins) {
  fill_bins(references, count, binning, bins);
}

HWY_ATTR HWY_INLINE ObjectSplit best_split(const ObjectBins& bins, int count) {
  ObjectSplit split;
  for (int axis = 0; axis < 3; ++axis) {
    float upper_cost[kMaxBins];
    Box8 box = nothing();
    std::uint32_t references = 0;
    for (int bin = count - 1; bin > 0; --bin) {
      box = join(box, load(bins.boxes[axis][bin]));
      references += bins.counts[axis][bin];
      upper_cost[bin] = references == 0 ? -1.0f : half_area(box) * static_cast<float>(references);
    }
    box = nothing();
    references = 0;
    for (int bin = 1; bin < count; ++bin) {
      box = join(box, load(bins.boxes[axis][bin - 1]));
      references += bins.counts[axis][bin - 1];
      if (references == 0 || upper_cost[bin] < 0.0f) continue;
      const float cost = half_area(box) * static_cast<float>(references) + upper_cost[bin];
      if (cost < split.cost) {
        split.cost = cost;
        split.axis = axis;
        split.bin = bin;
      }
    }
  }
  return split;
}

HWY_ATTR ObjectSplit best(const ObjectBins& bins, int count) {
  ObjectSplit split = best_split(bins, count);
  if (split.axis < 0) return split;
  Box8 lower = nothing(), upper = nothing();
  for (int bin = 0; bin < count; ++bin) {
    Box8& side = bin < split.bin ? lower : upper;
    side = join(side, load(bins.boxes[split.axis][bin]));
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
    std::uint32_t middle = count == 2 ? first + 1 : first + split(first, last, bounds, depth);
    const std::uint32_t pair = range_.first_pair + middle - 1;
    write_node(node, bounds, pair, count);
    Bounds8 side;
    bounds_of(range_.references + first, middle - first, side);
    build(first, middle, 2 * pair, side, depth + 1);
    bounds_of(range_.references + middle, last - middle, side);
    build(middle, last, 2 * pair + 1, side, depth + 1);
  }

  HWY_ATTR std::uint32_t split(std::uint32_t first, std::uint32_t last, const Bounds8& bounds,
                               int depth) {
    Reference* references = range_.references + first;
    const std::uint32_t count = last - first;
    if (depth < range_.sah_depth) {
      // Few bins tell few references apart.
      const Binning binning(bounds, count <= 8 ? 4 : count <= 32 ? 8 : range_.bins);
      bins_.clear(binning.bins);
      fill_bins(references, count, binning, bins_);
      const ObjectSplit chosen = best_split(bins_, binning.bins);
      if (chosen.axis >= 0) return partition(references, count, binning, chosen);
    }
    return split_by_rank(references, count, bounds);
  }

  // Stable and without branches on what falls where: those for the upper side wait in spare_.
  HWY_ATTR std::uint32_t partition(Reference* references, std::uint32_t count,
                                   const Binning& binning, const ObjectSplit& chosen) {
    const float low = binning.lower[chosen.axis], scale = binning.scale[chosen.axis];
    std::uint32_t lower = 0, upper = 0;
    if (spare_ == nullptr) spare_ = std::make_unique_for_overwrite<Reference[]>(range_.count);
    for (std::uint32_t i = 0; i < count; ++i) {
      const Box8 box = load(references[i]);
      const float position = (references[i].centre2(chosen.axis) - low) * scale;
      const bool is_lower = std::min(static_cast<int>(position), binning.bins - 1) < chosen.bin;
      store(box, spare_[upper].lower);
      store(box, references[lower].lower);
      lower += is_lower;
      upper += !is_lower;
    }
    std::memcpy(references + lower, spare_.get(), upper * sizeof(Reference));
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
HWY_EXPORT(subtree);

ObjectSplitter::ObjectSplitter() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  bounds = HWY_DISPATCH_TABLE(bounds)[index];
  fill = HWY_DISPATCH_TABLE(fill)[index];
  best = HWY_DISPATCH_TABLE(best)[index];
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
