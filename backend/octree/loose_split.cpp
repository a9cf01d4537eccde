#include "backend/octree/loose_split.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/loose_split.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "backend/octree/object_bins-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

HWY_ATTR Bounds8 loose_bounds(const LooseReference* references, std::uint32_t count) {
  return bounds_of(references, count);
}

HWY_ATTR void loose_fill(const LooseReference* references, std::uint32_t count,
                         const Binning& binning, ObjectBins& bins) {
  constexpr std::uint32_t kMany = 512;  // worth clearing and joining other bins
  if (count < kMany) {
    fill_bins(references, count, binning, bins, bins);
    return;
  }
  ObjectBins others;
  clear(others, binning.bins);
  fill_bins(references, count, binning, bins, others);
  for (int axis = 0; axis < 3; ++axis) {
    for (int bin = 0; bin < binning.bins; ++bin) {
      float* row = bins.boxes[axis][bin];
      store(lesser(load(row), load(others.boxes[axis][bin])), row);
      bins.counts[axis][bin] += others.counts[axis][bin];
    }
  }
}

// Without branches on the side, which nothing could predict.
HWY_ATTR std::uint32_t find_misplaced(LooseReference* references, std::uint32_t count,
                                      bool on_upper_side, const SidePlane& plane,
                                      Bounds8 (&bounds)[2]) {
  constexpr std::uint32_t kAhead = 32;
  TwoBounds both;
  std::uint32_t found = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    // The processor's own guess ends with a page.
    __builtin_prefetch(references + std::min(i + kAhead, count - 1));
    const float position = plane.position(references[i]);
    references[found].note = i;
    found += (position < plane.first_upper) == on_upper_side;
    both.add(load(references[i]), position, plane.first_upper);
  }
  both.get(bounds[0], bounds[1]);
  return found;
}

// The two axes that SpatialBinning::leave_out_shortest() leaves.
struct Axes {
  int axis[2];

  explicit Axes(const SpatialBinning& binning) {
    const int left_out = binning.shortest();
    axis[0] = left_out == 0 ? 1 : 0;
    axis[1] = left_out == 2 ? 1 : 2;
  }
  const int* begin() const { return axis; }
  const int* end() const { return axis + 2; }
};

// For each plane between two bins, what the box of what lies below or above it may not pass: a
// Box8, the greater of which and of a box is the box cut there.
struct Clips {
  alignas(32) float below[3][kMaxBins][8];  // [axis][i]: the plane between bins i and i + 1
  alignas(32) float above[3][kMaxBins][8];

  Clips(const SpatialBinning& binning, const Axes& axes) {
    for (const int axis : axes) {
      for (int bin = 0; bin + 1 < binning.bins; ++bin) {
        std::fill_n(below[axis][bin], 8, -std::numeric_limits<float>::infinity());
        std::fill_n(above[axis][bin], 8, -std::numeric_limits<float>::infinity());
        const float plane = binning.plane(axis, bin + 1);
        below[axis][bin][4 + axis] = -plane;
        above[axis][bin][axis] = plane;
      }
    }
  }
};

HWY_ATTR HWY_INLINE void join(const Box8& box, Bounds8& bin) {
  store(lesser(load(bin.box), box), bin.box);
}

// A box that lies in several bins along an axis.
HWY_ATTR HWY_NOINLINE void fill_across(const BuildInput& input, const LooseReference& reference,
                                       const std::int32_t* first, const std::int32_t* last,
                                       const SpatialBinning& binning, const Axes& axes,
                                       const Clips& clips, SpatialBins& bins) {
  const bool cuts = may_cut(input, reference.corners.geometry);
  for (const int axis : axes) {
    std::int32_t bin = first[axis], end = last[axis];
    if (!cuts) bin = end = binning.bin(0.5f * reference.centre2(axis), axis);
    ++bins.enter[axis][bin];
    ++bins.leave[axis][end];
    Box8 rest = load(reference);
    for (; bin < end; ++bin) {
      join(greater(rest, load(clips.below[axis][bin])), bins.parts[axis][bin]);
      rest = greater(rest, load(clips.above[axis][bin]));
    }
    join(rest, bins.parts[axis][bin]);
  }
}

// As fill_bins(), the first and the last bin of a few boxes first. Most lie in one bin.
HWY_ATTR void fill_space(const BuildInput& input, const LooseReference* references,
                         std::uint32_t count, const SpatialBinning& binning, SpatialBins& bins) {
  constexpr std::uint32_t kFew = 32;
  alignas(16) std::int32_t first[kFew][4], last[kFew][4];
  std::uint32_t within[3][kMaxBins] = {};  // boxes in one bin
  const Axes axes(binning);
  const Clips clips(binning, axes);
#if HWY_TARGET != HWY_SCALAR
  const hn::RebindToSigned<decltype(kHalfTag)> di;
  const auto low = hn::LoadU(kHalfTag, binning.lower);
  const auto scale = hn::LoadU(kHalfTag, binning.scale);
  const auto zero = hn::Zero(di), most = hn::Set(di, binning.bins - 1);
  const auto words = hn::FirstN(kHalfTag, 3);  // as in fill_bins()
#endif
  for (std::uint32_t start = 0; start < count; start += kFew) {
    const LooseReference* from = references + start;
    const std::uint32_t few = std::min(kFew, count - start);
    for (std::uint32_t i = 0; i < few; ++i) {
#if HWY_TARGET != HWY_SCALAR
      const auto lower = hn::Load(kHalfTag, from[i].lower);
      const auto upper = hn::Neg(hn::Load(kHalfTag, from[i].negated_upper));
      const auto begin =
          hn::ConvertTo(di, hn::Mul(hn::IfThenElseZero(words, hn::Sub(lower, low)), scale));
      const auto end =
          hn::ConvertTo(di, hn::Mul(hn::IfThenElseZero(words, hn::Sub(upper, low)), scale));
      hn::Store(hn::Min(hn::Max(begin, zero), most), di, first[i]);
      hn::Store(hn::Min(hn::Max(end, zero), most), di, last[i]);
#else
      for (int axis = 0; axis < 3; ++axis) {
        first[i][axis] = binning.bin(from[i].lower[axis], axis);
        last[i][axis] = binning.bin(-from[i].negated_upper[axis], axis);
      }
#endif
    }
    for (std::uint32_t i = 0; i < few; ++i) {
      const std::int32_t *begin = first[i], *end = last[i];
      if (((begin[0] ^ end[0]) | (begin[1] ^ end[1]) | (begin[2] ^ end[2])) != 0) {
        fill_across(input, from[i], begin, end, binning, axes, clips, bins);
        continue;
      }
      const Box8 box = load(from[i]);
      for (const int axis : axes) {
        join(box, bins.parts[axis][begin[axis]]);
        ++within[axis][begin[axis]];
      }
    }
  }
  for (const int axis : axes) {
    for (int bin = 0; bin < binning.bins; ++bin) {
      bins.enter[axis][bin] += within[axis][bin];
      bins.leave[axis][bin] += within[axis][bin];
    }
  }
}

HWY_ATTR void pack(const LooseReference* references, std::uint32_t count, Reference* to) {
  for (std::uint32_t i = 0; i < count; ++i) store(load(references[i]), to[i].lower);
}

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::octree {

HWY_EXPORT(loose_bounds);
HWY_EXPORT(loose_fill);
HWY_EXPORT(find_misplaced);
HWY_EXPORT(fill_space);
HWY_EXPORT(pack);

LooseSplitter::LooseSplitter() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  bounds = HWY_DISPATCH_TABLE(loose_bounds)[index];
  fill = HWY_DISPATCH_TABLE(loose_fill)[index];
  find_misplaced = HWY_DISPATCH_TABLE(find_misplaced)[index];
  fill_space = HWY_DISPATCH_TABLE(fill_space)[index];
  pack = HWY_DISPATCH_TABLE(pack)[index];
}

}  // namespace octrace::octree
#endif
