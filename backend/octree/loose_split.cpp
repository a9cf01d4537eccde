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
  fill_bins(references, count, binning, bins);
}

// Without branches on the side, which nothing could predict.
HWY_ATTR std::uint32_t find_misplaced(LooseReference* references, std::uint32_t count,
                                      bool on_upper_side, const Binning& binning,
                                      const ObjectSplit& split, Bounds8 (&bounds)[2]) {
  const Plane plane(binning, split);
  TwoBounds both;
  std::uint32_t found = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const float position = plane.position(references[i]);
    references[found].note = i;
    found += (position < plane.first_upper) == on_upper_side;
    both.add(load(references[i]), position, plane.first_upper);
  }
  both.get(bounds[0], bounds[1]);
  return found;
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
HWY_EXPORT(pack);

LooseSplitter::LooseSplitter() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  bounds = HWY_DISPATCH_TABLE(loose_bounds)[index];
  fill = HWY_DISPATCH_TABLE(loose_fill)[index];
  find_misplaced = HWY_DISPATCH_TABLE(find_misplaced)[index];
  pack = HWY_DISPATCH_TABLE(pack)[index];
}

}  // namespace octrace::octree
#endif
