// Leaves for rays that walk together: each triangle's edges and normal are computed once for all of
// them. Included once for each instruction set.
#if defined(OCTRACE_GROUP_LEAF_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_GROUP_LEAF_INL
#undef OCTRACE_GROUP_LEAF_INL
#else
#define OCTRACE_GROUP_LEAF_INL
#endif

#include "kernels/cpu/ray_group-inl.h"
#include "kernels/cpu/triangle_lanes-inl.h"
#include "kernels/cpu/wide_leaf-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

// Fewer triangles than this are tested one by one.
inline constexpr std::uint32_t kLeastLanes = 4;

// Some triangles of the leaf, a bit each, for one ray.
template <class Query>
HWY_ATTR HWY_INLINE void test(const SceneView& scene, const RenderParams& params, const float* rows,
                              std::uint32_t n, std::uint32_t i, std::uint32_t places, RayGroup& g) {
  if (test<Query>(scene, params, rows, n, places, g.slab_ray(i),
                  make_triangle_ray(g.direction_of(i)), g.tmin[i], g.state[i])) {
    g.alive &= ~(RaySet{1} << i);
  }
  g.tmax[i] = g.state[i].tmax;
}

// A ray and a triangle each, up to eight; there is room for eight.
template <class Query>
HWY_ATTR HWY_INLINE void test(const SceneView& scene, const RenderParams& params, const float* rows,
                              std::uint32_t n, std::int32_t* rays, std::int32_t* places,
                              std::uint32_t count, RayGroup& g) {
  if (count < kLeastLanes) {
    for (std::uint32_t k = 0; k < count; ++k) {
      test<Query>(scene, params, rows, n, static_cast<std::uint32_t>(rays[k]), 1u << places[k], g);
    }
    return;
  }
  const Floats d;
  const Words du;
  const hn::RebindToSigned<Floats> di;
  for (std::uint32_t k = count; k < 8; ++k) {
    rays[k] = rays[0];
    places[k] = places[0];
  }
  const auto index = hn::LoadU(di, rays);
  const auto place = hn::SetTableIndices(d, places);
  const auto of_ray = [&](const float* from) HWY_ATTR { return hn::GatherIndex(d, from, index); };
  const auto row = [&](std::uint32_t r)
                       HWY_ATTR { return hn::TableLookupLanes(hn::LoadU(d, rows + r * n), place); };
  RayLanes ray;
  TriangleLanes triangle;
  hn::Vec<Floats> direction[3];
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    direction[axis] = of_ray(g.direction[axis]);
    ray.origin[axis] = of_ray(g.origin[axis]);
    ray.inverse[axis] = of_ray(g.inverse[axis]);
    triangle.a[axis] = row(axis);
    triangle.b[axis] = row(3 + axis);
    triangle.c[axis] = row(6 + axis);
  }
  ray.shear = make_shear(direction);
  const auto culled = hn::And(hn::BitCast(du, row(kRowFlags)),
                              hn::Set(du, Query::culls(params, kCullBack) ? kCullBack : 0u));
  triangle.cull = hn::RebindMask(d, hn::Ne(culled, hn::Zero(du)));
  const HitLanes found = intersect_lanes(ray, triangle);
  const auto hit =
      hn::And(found.hit, hn::And(hn::Ge(found.t, of_ray(g.tmin)), hn::Le(found.t, of_ray(g.tmax))));
  const std::uint32_t lanes = (1u << count) - 1;
  alignas(32) float t[8], u[8], v[8];
  hn::Store(found.t, d, t);
  hn::Store(hn::Div(found.weight_b, found.determinant), d, u);
  hn::Store(hn::Div(found.weight_c, found.determinant), d, v);
  for (std::uint32_t left = bits_of(hit) & lanes; left != 0; left &= left - 1) {
    const int k = lowest_bit(left);
    const auto i = static_cast<std::uint32_t>(rays[k]);
    const auto word = [&](std::uint32_t r) {
      std::uint32_t bits;
      __builtin_memcpy(&bits, &rows[r * n + static_cast<std::uint32_t>(places[k])], sizeof bits);
      return bits;
    };
    RayState& state = g.state[i];
    // A lane before may have found something nearer for the same ray.
    if (t[k] <= state.tmax && Query::take(scene, params, state, {t[k], u[k], v[k]},
                                          word(kRowTriangle), word(kRowFlags))) {
      g.alive &= ~(RaySet{1} << i);
    }
    g.tmax[i] = state.tmax;
  }
  for (std::uint32_t left = bits_of(found.unsure) & lanes; left != 0; left &= left - 1) {
    const int k = lowest_bit(left);
    test<Query>(scene, params, rows, n, static_cast<std::uint32_t>(rays[k]), 1u << places[k], g);
  }
}

// Goes through a leaf's triangles for the rays of the set.
template <class Query>
HWY_ATTR HWY_INLINE void visit_leaf(const WideView& tree, const SceneView& scene,
                                    const RenderParams& params, WideRef ref, RaySet set,
                                    RayGroup& g) {
  const Floats d;
  const std::uint32_t n = leaf_count(ref);
  const float* rows = tree.leaf(ref);
  const LeafLanes leaf = load_leaf(rows, n);
  auto far = hn::Zero(d);
  for (int axis = 0; axis < 3; ++axis) {
    far = hn::Max(far, hn::Max(hn::Sub(leaf.a[axis], hn::Set(d, g.lower[axis])),
                               hn::Sub(hn::Set(d, g.upper[axis]), leaf.a[axis])));
  }
  const LeafMargins margins =
      leaf_margins(leaf, hn::Add(far, leaf.reach), g.edge, g.plane, g.ahead);
  const std::uint32_t all = (1u << n) - 1u;
  const std::uint32_t ends = Query::kAnyHit ? all & opaque(params, rows, n) : 0;
  RaySet hopeful = 0, ended = 0;
  for (RaySet left = set; left != 0; left &= left - 1) {
    const std::uint32_t i = lowest(left);
    const Candidates found = candidates<Query::kAnyHit>(leaf, margins, g.origin_of(i),
                                                        g.direction_of(i), g.tmin[i], g.tmax[i]);
    g.bits[i] = static_cast<std::uint8_t>(found.likely & all);
    hopeful |= static_cast<RaySet>((found.likely & all) != 0) << i;
    ended |= static_cast<RaySet>((found.certain & ends) != 0) << i;
  }
  if constexpr (Query::kAnyHit) {
    hopeful &= ~ended;
    g.alive &= ~ended;
    for (; ended != 0; ended &= ended - 1) g.state[lowest(ended)].opacity = kOpacityBlocked;
    for (; hopeful != 0; hopeful &= hopeful - 1) {
      const std::uint32_t i = lowest(hopeful);
      test<Query>(scene, params, rows, n, i, g.bits[i], g);
    }
    return;
  }
  alignas(32) std::int32_t rays[kGroupRays * kWideLanes], places[kGroupRays * kWideLanes];
  std::uint32_t count = 0;
  for (; hopeful != 0; hopeful &= hopeful - 1) {
    const std::uint32_t i = lowest(hopeful);
    for (std::uint32_t left = g.bits[i]; left != 0; left &= left - 1, ++count) {
      rays[count] = static_cast<std::int32_t>(i);
      places[count] = lowest_bit(left);
    }
  }
  for (std::uint32_t first = 0; first < count; first += 8) {
    const std::uint32_t size = count - first < 8 ? count - first : 8;
    test<Query>(scene, params, rows, n, rays + first, places + first, size, g);
  }
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
