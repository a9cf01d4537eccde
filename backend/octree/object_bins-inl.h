// Bins of references, the best split between them, and who goes where by it.
#if defined(OCTRACE_OBJECT_BINS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_OBJECT_BINS_INL
#undef OCTRACE_OBJECT_BINS_INL
#else
#define OCTRACE_OBJECT_BINS_INL
#endif

#include <algorithm>
#include <limits>

#include "backend/octree/box8-inl.h"
#include "backend/octree/object_split.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

// As ObjectBins::clear().
HWY_ATTR HWY_INLINE void clear(ObjectBins& bins, int count) {
  const hn::RebindToUnsigned<decltype(kTag)> du;
  for (int axis = 0; axis < 3; ++axis) {
    for (int bin = 0; bin < count; ++bin) store(infinities(), bins.boxes[axis][bin]);
    for (int bin = 0; bin < count; bin += static_cast<int>(kLanes)) {
      hn::Store(hn::Zero(du), du, bins.counts[axis] + bin);
    }
  }
}

// The bins of a few references first and then the boxes, so that the processor knows all addresses
// by the time it loads from them: references of one bin often follow each other.
// Every other one goes to `others`, which may be the same bins: where they are not, a reference
// does not wait for what the one before, of the same bin, has stored.
template <class R>
HWY_ATTR HWY_INLINE void fill_bins(const R* references, std::uint32_t count, const Binning& binning,
                                   ObjectBins& bins, ObjectBins& others) {
  constexpr std::uint32_t kFew = 32;
  alignas(16) std::int32_t bin[kFew][4];
#if HWY_TARGET != HWY_SCALAR
  const hn::RebindToSigned<decltype(kHalfTag)> di;
  const auto low = hn::LoadU(kHalfTag, binning.lower);
  const auto scale = hn::LoadU(kHalfTag, binning.scale);
  const auto most = hn::Set(di, binning.bins - 1);
  // What lies behind the axes are numbers whose products as floats take some processors long.
  const auto axes = hn::FirstN(kHalfTag, 3);
#endif
  for (std::uint32_t first = 0; first < count; first += kFew) {
    const R* from = references + first;
    const std::uint32_t few = std::min(kFew, count - first);
    for (std::uint32_t i = 0; i < few; ++i) {
#if HWY_TARGET != HWY_SCALAR
      const auto lower = hn::Load(kHalfTag, from[i].lower);
      const auto upper = hn::Load(kHalfTag, from[i].negated_upper);
      const auto offset = hn::Sub(hn::Sub(lower, upper), low);
      const auto position = hn::Mul(hn::IfThenElseZero(axes, offset), scale);
      hn::Store(hn::Min(hn::ConvertTo(di, position), most), di, bin[i]);
#else
      for (int axis = 0; axis < 3; ++axis) bin[i][axis] = binning.bin(from[i].centre2(axis), axis);
#endif
    }
    const auto add = [&](std::uint32_t i, ObjectBins& to) HWY_ATTR {
      const Box8 box = load(from[i]);
      for (int axis = 0; axis < 3; ++axis) {
        float* row = to.boxes[axis][bin[i][axis]];
        store(lesser(load(row), box), row);
        ++to.counts[axis][bin[i][axis]];
      }
    };
    std::uint32_t i = 0;
    for (; i + 1 < few; i += 2) {
      add(i, bins);
      add(i + 1, others);
    }
    if (i < few) add(i, bins);
  }
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

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // once for each instruction set
