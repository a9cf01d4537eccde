// Eight rays from an array, a ray a lane. Included once for each instruction set.
#if defined(OCTRACE_LOAD_RAYS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_LOAD_RAYS_INL
#undef OCTRACE_LOAD_RAYS_INL
#else
#define OCTRACE_LOAD_RAYS_INL
#endif

#include "kernels/cpu/wide_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

// In the order of Ray's members.
struct LoadedRays {
  hn::Vec<Floats> origin[3], tmin, direction[3], tmax;
};
static_assert(sizeof(Ray) == 8 * sizeof(float));

// Rays first .. first + 7 of rays[0, count), the last one again where there are fewer.
HWY_ATTR HWY_INLINE LoadedRays load_rays(const Ray* rays, std::uint32_t count,
                                         std::uint32_t first) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const hn::Repartition<std::uint64_t, Floats> d2;  // two floats
  const auto row = [&](std::uint32_t i) HWY_ATTR {
    const std::uint32_t ray = first + i < count ? first + i : count - 1;
    return hn::LoadU(d, reinterpret_cast<const float*>(rays + ray));
  };
  // Members 0 to 3 of four rays in the lower halves, 4 to 7 in the upper.
  const auto transpose = [&](std::uint32_t from, V* out) HWY_ATTR {
    const V a = row(from), b = row(from + 1), c = row(from + 2), e = row(from + 3);
    const auto ab = hn::BitCast(d2, hn::InterleaveLower(d, a, b));
    const auto ce = hn::BitCast(d2, hn::InterleaveLower(d, c, e));
    const auto ab_upper = hn::BitCast(d2, hn::InterleaveUpper(d, a, b));
    const auto ce_upper = hn::BitCast(d2, hn::InterleaveUpper(d, c, e));
    out[0] = hn::BitCast(d, hn::InterleaveLower(d2, ab, ce));
    out[1] = hn::BitCast(d, hn::InterleaveUpper(d2, ab, ce));
    out[2] = hn::BitCast(d, hn::InterleaveLower(d2, ab_upper, ce_upper));
    out[3] = hn::BitCast(d, hn::InterleaveUpper(d2, ab_upper, ce_upper));
  };
  V low[4], high[4];
  transpose(0, low);
  transpose(4, high);
  LoadedRays to;
  for (int axis = 0; axis < 3; ++axis) {
    to.origin[axis] = hn::ConcatLowerLower(d, high[axis], low[axis]);
    to.direction[axis] = hn::ConcatUpperUpper(d, high[axis], low[axis]);
  }
  to.tmin = hn::ConcatLowerLower(d, high[3], low[3]);
  to.tmax = hn::ConcatUpperUpper(d, high[3], low[3]);
  return to;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
