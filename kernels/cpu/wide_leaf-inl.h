// Leaves: what a walk asks of triangles, and which of a leaf's a ray hits. Included once for each
// instruction set.
#if defined(OCTRACE_WIDE_LEAF_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_WIDE_LEAF_INL
#undef OCTRACE_WIDE_LEAF_INL
#else
#define OCTRACE_WIDE_LEAF_INL
#endif

#include "kernels/cpu/wide_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

// What a walk asks. take() is told of a triangle that is hit at tmin <= t <= tmax and returns true
// to end the walk; it does what the leaf functors of kernels/intersect.h do.
struct ClosestQuery {
  static constexpr bool kAnyHit = false;
  static HWY_ATTR HWY_INLINE bool take(const SceneView& scene, const RenderParams& params,
                                       RayState& ray, const TriangleHit& found,
                                       std::uint32_t triangle, std::uint32_t flags) {
    if (ray.hit.valid() && found.t == ray.hit.t && triangle > ray.hit.triangle) return false;
    if ((flags & kAlphaTest) != 0 && params.alpha != 0 &&
        !alpha_passes(scene, scene.triangle_geometry[triangle], triangle, found.u, found.v)) {
      return false;
    }
    ray.hit = {found.t, found.u, found.v, triangle};
    ray.tmax = found.t;
    return false;
  }
  static bool culls(const RenderParams& params, std::uint32_t flags) {
    return params.cull != 0 && (flags & kCullBack) != 0;
  }
};

struct TransmittanceQuery {
  static constexpr bool kAnyHit = true;
  static HWY_ATTR HWY_INLINE bool take(const SceneView& scene, const RenderParams& params,
                                       RayState& ray, const TriangleHit& found,
                                       std::uint32_t triangle, std::uint32_t flags) {
    const bool alpha = params.alpha != 0 && (flags & (kAlphaTest | kBlend)) != 0;
    const std::uint32_t geometry = alpha ? scene.triangle_geometry[triangle] : 0;
    return dim(scene, params, {triangle, flags, geometry}, found, &ray.opacity);
  }
  static bool culls(const RenderParams&, std::uint32_t) { return false; }
};

// Rows of a leaf as vectors. What lies behind a row of few triangles reads as zero: it would be
// other rows, and indices and flags are denormal as floats; instructions that meet denormal
// numbers took an Intel processor half of its time (docs/performance.md).
class LeafReader {
 public:
  HWY_ATTR HWY_INLINE LeafReader(const float* rows, std::uint32_t n)
      : rows_(rows), n_(n), used_(hn::FirstN(Floats(), n)) {}
  HWY_ATTR HWY_INLINE hn::Vec<Floats> operator()(std::uint32_t row) const {
    return hn::IfThenElseZero(used_, hn::LoadU(Floats(), rows_ + row * n_));
  }

 private:
  const float* rows_;
  std::uint32_t n_;
  hn::Mask<Floats> used_;
};

HWY_ATTR HWY_INLINE void cross(const hn::Vec<Floats>* a, const hn::Vec<Floats>* b,
                               hn::Vec<Floats>* out) {
  for (int x = 0; x < 3; ++x) {
    const int y = (x + 1) % 3, z = (x + 2) % 3;
    out[x] = hn::MulSub(a[y], b[z], hn::Mul(a[z], b[y]));
  }
}

HWY_ATTR HWY_INLINE hn::Vec<Floats> dot(const hn::Vec<Floats>* a, const hn::Vec<Floats>* b) {
  return hn::MulAdd(a[0], b[0], hn::MulAdd(a[1], b[1], hn::Mul(a[2], b[2])));
}

// Which triangles of a leaf a ray may hit: a test by signed volumes, a triangle a lane (after
// Moeller and Trumbore 1997).
//
// It never drops a triangle that intersect_triangle() hits. Let M bound the distance along an axis
// from the ray's origin to the triangle's corners, S its longest side, D the largest component of
// the direction. intersect_triangle() decides by corners that are within 2^-21 M of
// the true ones, across the ray, so a triangle that it hits has edge functions that miss having one
// sign by at most 12 * 2^-21 M S: 12 * 2^-21 M S D in the volumes here, whose own roundings are
// below 2^-17 M S D. `edge` allows 2^-16 M S D. It computes t from weights that are off by 2^-11
// altogether (triangle.h), hence from a point of the triangle's plane within 2^-11 S along that
// plane (`ahead`) and, all roundings counted, 2^-15 M S^2 in units of the normal (`plane`).
// Numbers that are not lets a triangle pass. S and M come from the leaf's row of reaches W: S <= W,
// M <= t D + W, where the ray enters the leaf's box at t.
struct LeafLanes {
  hn::Vec<Floats> a[3], to_b[3], to_c[3], normal[3];  // to_b is a - b, to_c is c - a
  hn::Vec<Floats> reach;
};

HWY_ATTR HWY_INLINE LeafLanes load_leaf(const float* rows, std::uint32_t n) {
  const Floats d;
  const LeafReader row(rows, n);
  LeafLanes leaf;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    leaf.a[axis] = row(axis);
    leaf.to_b[axis] = hn::Sub(leaf.a[axis], row(3 + axis));
    leaf.to_c[axis] = hn::Sub(row(6 + axis), leaf.a[axis]);
  }
  cross(leaf.to_c, leaf.to_b, leaf.normal);
  leaf.reach = row(kRowReach);
  return leaf;
}

// How far the test may be wrong.
struct LeafMargins {
  hn::Vec<Floats> edge, plane, ahead;
};

// `far`: M.
HWY_ATTR HWY_INLINE LeafMargins leaf_margins(const LeafLanes& leaf, hn::Vec<Floats> far, float edge,
                                             float plane, float ahead) {
  const Floats d;
  const auto area = hn::Mul(leaf.reach, far);
  const auto tiny = hn::Set(d, 1e-37f);
  return {hn::MulAdd(area, hn::Set(d, edge), tiny),
          hn::MulAdd(hn::Mul(area, leaf.reach), hn::Set(d, plane), tiny),
          hn::Mul(leaf.reach, hn::Set(d, ahead))};
}

// A bit for each triangle of the leaf.
struct Candidates {
  std::uint32_t likely, certain;
};

// Where kCertain, also which ones intersect_triangle() is sure to hit: it errs no farther to that
// side.
template <bool kCertain>
HWY_ATTR HWY_INLINE Candidates candidates(const LeafLanes& leaf, const LeafMargins& margins,
                                          const Vec3& origin, const Vec3& direction, float tmin,
                                          float tmax) {
  const Floats d;
  using V = hn::Vec<Floats>;
  V o[3], to[3], across[3];
  for (int axis = 0; axis < 3; ++axis) {
    o[axis] = hn::Sub(leaf.a[axis], hn::Set(d, origin[axis]));
    to[axis] = hn::Set(d, direction[axis]);
  }
  cross(o, to, across);
  const V volume = dot(leaf.normal, to), u = dot(across, leaf.to_c), v = dot(across, leaf.to_b);
  const V w = hn::Sub(hn::Sub(volume, u), v);
  const V sign = hn::And(volume, hn::Set(d, -0.0f));
  const V distance = hn::Xor(dot(leaf.normal, o), sign);
  const V size = hn::Xor(volume, sign);
  const V least = hn::Min(hn::Min(u, v), w), most = hn::Max(hn::Max(u, v), w);
  const V first = hn::Set(d, tmin), last = hn::Set(d, tmax);
  const auto beside = hn::And(hn::Lt(least, hn::Neg(margins.edge)), hn::Gt(most, margins.edge));
  const auto before =
      hn::Lt(distance, hn::MulSub(size, hn::Sub(first, margins.ahead), margins.plane));
  const auto after =
      hn::Gt(distance, hn::MulAdd(size, hn::Add(last, margins.ahead), margins.plane));
  Candidates result = {~bits_of(hn::Or(beside, hn::Or(before, after))), 0};
  if constexpr (kCertain) {
    const auto inside = hn::Or(hn::Gt(least, margins.edge), hn::Lt(most, hn::Neg(margins.edge)));
    const auto between =
        hn::And(hn::Gt(distance, hn::MulAdd(size, hn::Add(first, margins.ahead), margins.plane)),
                hn::Lt(distance, hn::MulSub(size, hn::Sub(last, margins.ahead), margins.plane)));
    result.certain = bits_of(hn::And(inside, between));
  }
  return result;
}

// Of a leaf's triangles those that end a query for any hit, whatever their material.
HWY_ATTR HWY_INLINE std::uint32_t opaque(const RenderParams& params, const float* rows,
                                         std::uint32_t n) {
  const Words du;
  const auto* flags = reinterpret_cast<const std::uint32_t*>(rows + kRowFlags * n);
  const auto clear = hn::Set(du, params.alpha != 0 ? kAlphaTest | kBlend : 0u);
  const auto none = hn::Eq(hn::And(hn::LoadU(du, flags), clear), hn::Zero(du));
  return bits_of(hn::RebindMask(Floats(), none));
}

template <class Query>
HWY_ATTR HWY_INLINE Candidates candidates(const WideView& tree, const RenderParams& params,
                                          const WideRay& ray) {
  const Floats d;
  const std::uint32_t n = leaf_count(ray.ref), all = (1u << n) - 1u;
  const float* rows = tree.leaf(ray.ref);
  const LeafLanes leaf = load_leaf(rows, n);
  const auto far = hn::MulAdd(hn::Set(d, ray.t), hn::Set(d, ray.largest), leaf.reach);
  const LeafMargins margins = leaf_margins(leaf, far, ray.edge, ray.plane, ray.ahead);
  const Candidates found =
      candidates<Query::kAnyHit>(leaf, margins, ray.slab.origin, ray.direction, ray.tmin, ray.tmax);
  const std::uint32_t ends = Query::kAnyHit ? all & opaque(params, rows, n) : 0;
  return {found.likely & all, found.certain & ends};
}

// Tests the candidates with intersect_triangle(). True: the walk is over.
template <class Query>
HWY_ATTR HWY_INLINE bool test(const SceneView& scene, const RenderParams& params, const float* rows,
                              std::uint32_t n, std::uint32_t left, const SlabRay& slab,
                              const TriangleRay& shear, float tmin, RayState& ray) {
  for (; left != 0; left &= left - 1) {
    const float* corners = rows + lowest_bit(left);
    const auto corner = [&](std::uint32_t r) {
      return Vec3(corners[r * n], corners[(r + 1) * n], corners[(r + 2) * n]);
    };
    const auto word = [&](std::uint32_t r) {
      std::uint32_t value;
      __builtin_memcpy(&value, &corners[r * n], sizeof value);
      return value;
    };
    const std::uint32_t flags = word(kRowFlags);
    TriangleHit found;
    if (intersect_triangle(slab, shear, corner(0), corner(3), corner(6), tmin, ray.tmax,
                           Query::culls(params, flags), &found) &&
        Query::take(scene, params, ray, found, word(kRowTriangle), flags)) {
      return true;
    }
  }
  return false;
}

template <class Query>
HWY_ATTR HWY_INLINE bool test(const WideView& tree, const SceneView& scene,
                              const RenderParams& params, WideRay& ray, std::uint32_t left) {
  const float tmax = ray.tmax;
  if (test<Query>(scene, params, tree.leaf(ray.ref), leaf_count(ray.ref), left, ray.slab, ray.shear,
                  ray.tmin, ray)) {
    return true;
  }
  if (ray.tmax < tmax) drop_far(ray);
  return false;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
