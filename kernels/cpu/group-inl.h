// Many rays that start close together, whatever their directions: one walk for all of them. A node
// is read once and its eight boxes are tested against each of the rays that reach it; a set of rays
// goes on to each child (after Barringer and Akenine-Moeller 2014, "Dynamic ray stream traversal").
// Included once for each instruction set.
#if defined(OCTRACE_GROUP_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_GROUP_INL
#undef OCTRACE_GROUP_INL
#else
#define OCTRACE_GROUP_INL
#endif

#include "kernels/cpu/group_leaf-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

// Groups that are taken in turns, a step each, so that one's cache misses pass while the others
// work.
inline constexpr std::uint32_t kGroups = 8;

// Where a step, of a node or a leaf, is worth fewer than five halves of rays, they cost less in a
// stream.
inline constexpr std::uint32_t kLeastRays = 5, kPerSteps = 2;

// Rays in all steps of a group, after which its rays are left to a stream: origins far apart, or
// rays that come from either side, can lead a group through most of a scene.
inline constexpr std::uint32_t kMostVisits = kGroupRays * 256;

// Rays that trace_groups() began and gave up.
struct GivenUp {
  std::uint32_t first[kGroups], count[kGroups];
  std::uint32_t groups = 0;
};

// By insertion: there are few. Of equal distances the last one comes first, as with single rays.
HWY_ATTR HWY_INLINE void sort_far_to_near(RayGroup& g, std::uint32_t first, std::uint32_t end) {
  for (std::uint32_t i = first + 1; i < end; ++i) {
    const float t = g.stack_t[i];
    const WideRef ref = g.stack_ref[i];
    const RaySet set = g.stack_set[i];
    std::uint32_t place = i;
    for (; place > first && g.stack_t[place - 1] < t; --place) {
      g.stack_t[place] = g.stack_t[place - 1];
      g.stack_ref[place] = g.stack_ref[place - 1];
      g.stack_set[place] = g.stack_set[place - 1];
    }
    g.stack_t[place] = t;
    g.stack_ref[place] = ref;
    g.stack_set[place] = set;
  }
}

// Puts the children that the rays of the set meet on the stack.
template <bool kNearest>
HWY_ATTR HWY_INLINE std::uint32_t visit_node(const WideView& tree, WideRef ref, RaySet set,
                                             RayGroup& g, std::uint32_t depth) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const WideNode& node = tree.node(ref);
  // Padded by 2^-19 times the farthest plane's distance from any of the origins: see wide_node.h.
  V farthest = hn::Zero(d);
  for (int axis = 0; axis < 3; ++axis) {
    const V far = hn::Max(hn::Sub(hn::Load(d, node.planes[axis][1]), hn::Set(d, g.lower[axis])),
                          hn::Sub(hn::Set(d, g.upper[axis]), hn::Load(d, node.planes[axis][0])));
    farthest = hn::Max(farthest, far);
  }
  const V padding = hn::Mul(farthest, hn::Set(d, kChildPadding));
  alignas(64) float planes[3][2][8];
  for (int axis = 0; axis < 3; ++axis) {
    hn::Store(hn::Sub(hn::Load(d, node.planes[axis][0]), padding), d, planes[axis][0]);
    hn::Store(hn::Add(hn::Load(d, node.planes[axis][1]), padding), d, planes[axis][1]);
  }
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(planes);
  const auto plane = [&](std::uint32_t offset) HWY_ATTR {
    return hn::Load(d, reinterpret_cast<const float*>(bytes + offset));
  };
  V least = hn::Set(d, std::numeric_limits<float>::infinity());
  for (RaySet left = set; left != 0; left &= left - 1) {
    const std::uint32_t i = lowest(left);
    const std::uint32_t ex = g.entered[0][i], ey = g.entered[1][i], ez = g.entered[2][i];
    const auto ix = hn::Set(d, g.inverse[0][i]), iy = hn::Set(d, g.inverse[1][i]);
    const auto iz = hn::Set(d, g.inverse[2][i]);
    const auto nx = hn::MulAdd(plane(ex), ix, hn::Set(d, g.enter[0][i]));
    const auto ny = hn::MulAdd(plane(ey), iy, hn::Set(d, g.enter[1][i]));
    const auto nz = hn::MulAdd(plane(ez), iz, hn::Set(d, g.enter[2][i]));
    const auto fx = hn::MulAdd(plane(ex ^ 32), ix, hn::Set(d, g.leave[0][i]));
    const auto fy = hn::MulAdd(plane(ey ^ 32), iy, hn::Set(d, g.leave[1][i]));
    const auto fz = hn::MulAdd(plane(ez ^ 32), iz, hn::Set(d, g.leave[2][i]));
    const auto near = hn::Max(hn::Max(nx, ny), hn::Max(nz, hn::Set(d, g.tmin[i])));
    const auto far = hn::Min(hn::Min(fx, fy), hn::Min(fz, hn::Set(d, g.tmax[i])));
    const auto met = hn::Le(near, far);
    if constexpr (kNearest) least = hn::IfThenElse(met, hn::Min(least, near), least);
    hn::StoreMaskBits(d, met, g.bits + i);
  }
  const std::uint32_t start = depth;
  alignas(32) float near_of[8];
  if constexpr (kNearest) hn::Store(least, d, near_of);
  const hn::CappedTag<std::uint8_t, kGroupRays> db;
  const auto low = hn::Load(db, g.bits), high = hn::Load(db, g.bits + kGroupRays - hn::Lanes(db));
  for (std::uint32_t slot = 0; slot < 8; ++slot) {
    const auto bit = hn::Set(db, static_cast<std::uint8_t>(1u << slot));
    std::uint8_t raw[16];
    hn::StoreMaskBits(db, hn::TestBit(low, bit), raw);
    if (hn::Lanes(db) < kGroupRays) hn::StoreMaskBits(db, hn::TestBit(high, bit), raw + 4);
    RaySet met;
    __builtin_memcpy(&met, raw, sizeof met);
    met &= set;
    g.stack_ref[depth] = node.child[slot];
    g.stack_set[depth] = met;
    if constexpr (kNearest) g.stack_t[depth] = near_of[slot];
    depth += met != 0;
  }
  if constexpr (kNearest) sort_far_to_near(g, start, depth);
  return depth;
}

// The rays that have found nothing before t.
HWY_ATTR HWY_INLINE RaySet beyond(const RayGroup& g, float t) {
  const Floats d;
  RaySet set = 0;
  for (std::uint32_t i = 0; i < kGroupRays; i += 8) {
    const auto before = hn::Ge(hn::Load(d, g.tmax + i), hn::Set(d, t));
    set |= static_cast<RaySet>(bits_of(before)) << i;
  }
  return set;
}

// Takes the next node or leaf that some of the rays may meet. False: there is none.
template <class Query>
HWY_ATTR HWY_INLINE bool step(const WideView& tree, const SceneView& scene,
                              const RenderParams& params, RayGroup& g) {
  std::uint32_t depth = g.depth;
  WideRef ref = 0;
  RaySet set = 0;
  while (set == 0) {
    if (depth == 0) return false;
    --depth;
    ref = g.stack_ref[depth];
    set = g.stack_set[depth] & g.alive;
    if constexpr (!Query::kAnyHit) set &= beyond(g, g.stack_t[depth]);
  }
  ++g.steps;
  g.visits += static_cast<std::uint32_t>(__builtin_popcountll(set));
  if (ref & kLeafRef) {
    visit_leaf<Query>(tree, scene, params, ref, set, g);
  } else {
    depth = visit_node<!Query::kAnyHit>(tree, ref, set, g, depth);
  }
  g.depth = depth;
  if (depth != 0) prefetch(tree, g.stack_ref[depth - 1]);
  return true;
}

// Calls store(index, ray) for rays from rays[0] on, but for those given up, and returns how many it
// has begun: all of `count`, or fewer where they go such different ways that they cost less on
// their own.
template <class Query, class Store>
HWY_ATTR HWY_INLINE std::uint32_t trace_groups(const WideView& from, const SceneView& scene,
                                               const RenderParams& params, const Ray* rays,
                                               std::uint32_t count, RayGroup* groups,
                                               GivenUp& given_up, const Store& store) {
  const WideView tree = from;  // so that stores leave it in registers
  std::uint32_t next = 0, active = 0;
  const auto start = [&](RayGroup& g) HWY_ATTR {
    g.count = count - next < kGroupRays ? count - next : kGroupRays;
    if (g.count == 0) return;
    begin(tree, rays + next, g.count, g);
    g.first = next;
    next += g.count;
    ++active;
  };
  for (std::uint32_t k = 1; k < kGroups; ++k) groups[k].count = 0;
  start(groups[0]);  // alone, to see
  bool alone = true;
  std::uint32_t steps = 0, visits = 0;  // of groups that have ended, the last counting most
  while (active != 0) {
    for (std::uint32_t k = 0; k < kGroups; ++k) {
      RayGroup& g = groups[k];
      if (g.count == 0) continue;
      if (g.visits > kMostVisits) {
        given_up.first[given_up.groups] = g.first;
        given_up.count[given_up.groups++] = g.count;
        g.count = 0;
        --active;
        count = next;  // so at most kGroups are given up
        continue;
      }
      if (step<Query>(tree, scene, params, g)) continue;
      for (std::uint32_t i = 0; i < g.count; ++i) store(g.first + i, g.state[i]);
      g.count = 0;
      --active;
      steps = steps / 2 + g.steps;
      visits = visits / 2 + g.visits;
      if (kPerSteps * visits < kLeastRays * steps) count = next;
      start(g);
      for (std::uint32_t j = 1; alone && j < kGroups; ++j) start(groups[j]);
      alone = false;
    }
  }
  return next;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
