// Eight floats in as many registers as the instruction set needs. Included once for each of them.
#if defined(OCTRACE_EIGHT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_EIGHT_INL
#undef OCTRACE_EIGHT_INL
#else
#define OCTRACE_EIGHT_INL
#endif

#include <hwy/highway.h>

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, 8> kTag;
using Vector = hn::Vec<decltype(kTag)>;
constexpr std::size_t kLanes = hn::MaxLanes(kTag);
constexpr std::size_t kParts = 8 / kLanes;

struct Eight {
  Vector part[kParts] = {};
};

HWY_ATTR HWY_INLINE Eight load(const float* from) {
  Eight v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Load(kTag, from + i * kLanes);
  return v;
}
HWY_ATTR HWY_INLINE void store(const Eight& v, float* to) {
  for (std::size_t i = 0; i < kParts; ++i) hn::Store(v.part[i], kTag, to + i * kLanes);
}
HWY_ATTR HWY_INLINE Eight eight(float value) {
  Eight v;
  for (auto& part : v.part) part = hn::Set(kTag, value);
  return v;
}
HWY_ATTR HWY_INLINE Eight infinities() { return eight(std::numeric_limits<float>::infinity()); }
HWY_ATTR HWY_INLINE Eight lesser(const Eight& a, const Eight& b) {
  Eight v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Min(a.part[i], b.part[i]);
  return v;
}
HWY_ATTR HWY_INLINE Eight greater(const Eight& a, const Eight& b) {
  Eight v;
  for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Max(a.part[i], b.part[i]);
  return v;
}
// The least of the eight, in all lanes.
HWY_ATTR HWY_INLINE Vector least_of(const Eight& v) {
  Vector all = v.part[0];
  for (std::size_t i = 1; i < kParts; ++i) all = hn::Min(all, v.part[i]);
  return hn::MinOfLanes(kTag, all);
}
// The first of the eight that has the value; 0 where none has.
HWY_ATTR HWY_INLINE std::uint32_t first_of(const Eight& v, Vector value) {
  for (std::size_t i = 0; i < kParts; ++i) {
    const auto at = hn::FindFirstTrue(kTag, hn::Eq(v.part[i], value));
    if (at >= 0) return static_cast<std::uint32_t>(i * kLanes + static_cast<std::size_t>(at));
  }
  return 0;
}
HWY_ATTR HWY_INLINE Vector slots(std::size_t part) {
  return hn::Iota(kTag, static_cast<float>(part * kLanes));
}

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // once for each instruction set
