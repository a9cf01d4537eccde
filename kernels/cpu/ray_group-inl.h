// Rays that walk together, prepared for boxes and triangles. Included once for each instruction
// set.
#if defined(OCTRACE_RAY_GROUP_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_RAY_GROUP_INL
#undef OCTRACE_RAY_GROUP_INL
#else
#define OCTRACE_RAY_GROUP_INL
#endif

#include "kernels/cpu/load_rays-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

inline constexpr std::uint32_t kGroupRays = 64;
using RaySet = std::uint64_t;  // a bit a ray

struct alignas(64) RayGroup {
  float origin[3][kGroupRays], direction[3][kGroupRays], inverse[3][kGroupRays];
  // A plane p is met at p * inverse + enter where a box is entered, + leave where it is left.
  float enter[3][kGroupRays], leave[3][kGroupRays];
  std::uint32_t entered[3][kGroupRays];  // where a node keeps the planes that are entered, in bytes
  float tmin[kGroupRays], tmax[kGroupRays];
  RayState state[kGroupRays];
  RaySet alive;                 // those that look for more
  std::uint32_t first, count;   // which rays these are; none: the group is not in use
  std::uint32_t depth;          // entries on the stack
  std::uint32_t steps, visits;  // taken, and rays that took part in them
  // Bounds over the rays.
  float lower[3], upper[3];  // of the origins
  float edge, plane, ahead;  // see candidates() in wide_leaf-inl.h
  // By ray, what it meets of a node or a leaf: a bit a child, or a triangle.
  alignas(64) std::uint8_t bits[kGroupRays + 8];
  alignas(64) WideRef stack_ref[kWideStack];
  RaySet stack_set[kWideStack];
  float stack_t[kWideStack];  // where the first of its rays enters it; unused for any hit

  Vec3 origin_of(std::uint32_t i) const { return Vec3(origin[0][i], origin[1][i], origin[2][i]); }
  Vec3 direction_of(std::uint32_t i) const {
    return Vec3(direction[0][i], direction[1][i], direction[2][i]);
  }
  SlabRay slab_ray(std::uint32_t i) const {
    return {origin_of(i), 0, Vec3(inverse[0][i], inverse[1][i], inverse[2][i])};
  }
};

OCTRACE_FORCE_INLINE std::uint32_t lowest(RaySet set) {
  return static_cast<std::uint32_t>(__builtin_ctzll(set));
}

HWY_ATTR HWY_INLINE void begin(const WideView& tree, const Ray* rays, std::uint32_t count,
                               RayGroup& g) {
  const Floats d;
  const Words du;
  using V = hn::Vec<Floats>;
  for (std::uint32_t i = 0; i < count; ++i) {
    g.state[i] = {{rays[i].tmax, 0.0f, 0.0f, kNone}, rays[i].tmax, 0};
  }
  const RaySet all = count == kGroupRays ? ~RaySet{0} : (RaySet{1} << count) - 1;
  V largest = hn::Zero(d), smallest = hn::Set(d, std::numeric_limits<float>::infinity());
  V lower[3], upper[3];
  for (int axis = 0; axis < 3; ++axis) lower[axis] = smallest, upper[axis] = hn::Neg(smallest);
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), tiny = hn::Set(d, kTinyDirection);
  for (std::uint32_t first = 0; first < count; first += 8) {
    const LoadedRays loaded = load_rays(rays, count, first);
    hn::Store(loaded.tmin, d, g.tmin + first);
    hn::Store(loaded.tmax, d, g.tmax + first);
    V length = zero;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const V x = loaded.direction[axis], o = loaded.origin[axis];
      hn::Store(x, d, g.direction[axis] + first);
      hn::Store(o, d, g.origin[axis] + first);
      length = hn::Max(length, hn::Abs(x));
      const auto negative = hn::Lt(x, zero);
      const V kept = hn::IfThenElse(hn::Lt(hn::Abs(x), tiny),
                                    hn::IfThenElse(negative, hn::Neg(tiny), tiny), x);
      const V inverse = hn::Div(one, kept);
      const V base = hn::Neg(hn::Mul(o, inverse));
      // 2^-24 of it here, in the sums below, and in the planes that visit_node() pads.
      const V lost = hn::Mul(hn::Abs(base), hn::Set(d, 0x1p-22f));
      hn::Store(inverse, d, g.inverse[axis] + first);
      hn::Store(hn::Sub(base, lost), d, g.enter[axis] + first);
      hn::Store(hn::Add(base, lost), d, g.leave[axis] + first);
      hn::Store(hn::IfThenElse(hn::RebindMask(du, negative), hn::Set(du, axis * 64 + 32),
                               hn::Set(du, axis * 64)),
                du, g.entered[axis] + first);
      // In this order a ray that is no number leaves the bounds as they are: x86 takes the second.
      lower[axis] = hn::Min(o, lower[axis]);
      upper[axis] = hn::Max(o, upper[axis]);
    }
    largest = hn::Max(length, largest);
    smallest = hn::Min(length, smallest);
  }
  float farthest = 0.0f;
  for (int axis = 0; axis < 3; ++axis) {
    g.lower[axis] = hn::GetLane(hn::MinOfLanes(d, lower[axis]));
    g.upper[axis] = hn::GetLane(hn::MaxOfLanes(d, upper[axis]));
    farthest = greater(farthest,
                       greater(tree.upper[axis] - g.lower[axis], g.upper[axis] - tree.lower[axis]));
  }
  const float most = hn::GetLane(hn::MaxOfLanes(d, largest));
  const bool sane = farthest * farthest * greater(farthest, most) < 1e30f;
  const float infinity = std::numeric_limits<float>::infinity();
  g.edge = sane ? most * 0x1p-16f : infinity;
  g.plane = sane ? 0x1p-15f : infinity;
  g.ahead = 0x1p-11f / hn::GetLane(hn::MinOfLanes(d, smallest));
  g.alive = g.stack_set[0] = all;
  g.stack_ref[0] = 0;
  g.stack_t[0] = -std::numeric_limits<float>::infinity();
  g.depth = 1;
  g.steps = g.visits = 0;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
