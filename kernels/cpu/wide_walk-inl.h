// A ray's walk over the wide nodes, in steps: a node, or a leaf. Included once for each instruction
// set, between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE of the file that includes it.
#if defined(OCTRACE_WIDE_WALK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_WIDE_WALK_INL
#undef OCTRACE_WIDE_WALK_INL
#else
#define OCTRACE_WIDE_WALK_INL
#endif

#include <hwy/highway.h>

#include <limits>

#include "kernels/cpu/wide_node.h"
#include "kernels/intersect.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::FixedTag<float, 8>;
using Words = hn::RebindToUnsigned<Floats>;

// A node leaves at most seven entries beside the one that is taken next, and eight are written at a
// time; one more is the bottom.
inline constexpr std::uint32_t kWideStack = 7 * kMaxDepth + 16;

struct alignas(64) WideRay {
  SlabRay slab;
  TriangleRay shear;
  float tmin, tmax;
  float reach;             // largest component of the direction * 2^-19
  float slope[3];          // |1 / direction|
  std::uint32_t enter[3];  // where a node keeps the planes that are entered, in bytes
  // What is next, and where along the ray it begins.
  WideRef ref;
  float t;
  std::uint32_t depth;  // entries on the stack
  std::uint32_t opacity;
  std::uint32_t index;
  Hit hit;
  alignas(32) float stack_t[kWideStack];
  alignas(32) WideRef stack_ref[kWideStack];
};

// Slots in the order of their visit from the last one backwards, by octant.
alignas(32) inline constexpr std::uint32_t kFarToNear[8][8] = {
    {7, 6, 5, 4, 3, 2, 1, 0}, {6, 7, 4, 5, 2, 3, 0, 1}, {5, 4, 7, 6, 1, 0, 3, 2},
    {4, 5, 6, 7, 0, 1, 2, 3}, {3, 2, 1, 0, 7, 6, 5, 4}, {2, 3, 0, 1, 6, 7, 4, 5},
    {1, 0, 3, 2, 5, 4, 7, 6}, {0, 1, 2, 3, 4, 5, 6, 7}};

// Selected without a branch, because whether a leaf comes next cannot be guessed.
HWY_ATTR HWY_INLINE void prefetch(const WideView& tree, WideRef ref) {
  const std::uintptr_t leaf = 0 - std::uintptr_t{ref >> 31};
  const auto nodes = reinterpret_cast<std::uintptr_t>(tree.nodes);
  const auto leaves = reinterpret_cast<std::uintptr_t>(tree.leaves);
  const std::uintptr_t base = nodes ^ ((nodes ^ leaves) & leaf);
  const std::uintptr_t scale = sizeof(WideNode) - ((sizeof(WideNode) - 4 * kLeafRows) & leaf);
  const char* from = reinterpret_cast<const char*>(base + (ref & (kMaxWideTriangles - 1)) * scale);
  __builtin_prefetch(from);
  __builtin_prefetch(from + 64);
  __builtin_prefetch(from + 128);
  __builtin_prefetch(from + 192);
}

// Takes the nearest entry that begins before tmax. The bottom of the stack begins at -infinity.
HWY_ATTR HWY_INLINE void pop(WideRay& ray) {
  const float tmax = ray.tmax;
  std::uint32_t depth = ray.depth - 1;
  while (ray.stack_t[depth] > tmax) --depth;
  ray.depth = depth;
  ray.t = ray.stack_t[depth];
  ray.ref = ray.stack_ref[depth];
}

HWY_ATTR HWY_INLINE void begin(const WideView& tree, const Ray& from, std::uint32_t index,
                               WideRay& ray) {
  ray.slab = make_slab_ray(from);
  ray.shear = make_triangle_ray(from.direction);
  ray.tmin = from.tmin;
  ray.tmax = from.tmax;
  ray.index = index;
  ray.opacity = 0;
  ray.hit = {from.tmax, 0.0f, 0.0f, kNone};
  ray.stack_t[0] = -std::numeric_limits<float>::infinity();
  ray.stack_ref[0] = kDoneRef;
  ray.depth = 0;
  ray.ref = kDoneRef;
  float reach = 0.0f, farthest = 0.0f;
  for (int axis = 0; axis < 3; ++axis) {
    ray.slope[axis] = abs_of(ray.slab.inverse[axis]);
    ray.enter[axis] = static_cast<std::uint32_t>(axis) * 64 + ((ray.slab.octant >> axis) & 1u) * 32;
    reach = greater(reach, abs_of(from.direction[axis]));
    farthest = greater(farthest, greater(abs_of(tree.lower[axis] - from.origin[axis]),
                                         abs_of(tree.upper[axis] - from.origin[axis])));
  }
  ray.reach = reach * kChildPadding;
  const float padding = farthest * kChildPadding;
  float near = from.tmin, far = from.tmax;
  for (int axis = 0; axis < 3; ++axis) {
    const float a = (tree.lower[axis] - from.origin[axis]) * ray.slab.inverse[axis];
    const float b = (tree.upper[axis] - from.origin[axis]) * ray.slab.inverse[axis];
    near = greater(near, lesser(a, b) - padding * ray.slope[axis]);
    far = lesser(far, greater(a, b) + padding * ray.slope[axis]);
  }
  if (!(near <= far)) return;
  ray.depth = 1;
  ray.t = near;
  ray.ref = 0;
}

// Puts the children that the ray meets on the stack, the nearest on top.
HWY_ATTR HWY_INLINE void visit_node(const WideView& tree, WideRay& ray) {
  const Floats d;
  const Words du;
  const WideNode& node = tree.nodes[ray.ref];
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&node);
  const auto plane = [&](std::uint32_t offset) HWY_ATTR {
    return hn::Load(d, reinterpret_cast<const float*>(bytes + offset));
  };
  const auto padding = hn::Set(d, ray.t * ray.reach + node.extent);
  const auto ox = hn::Set(d, ray.slab.origin.x), ix = hn::Set(d, ray.slab.inverse.x);
  const auto oy = hn::Set(d, ray.slab.origin.y), iy = hn::Set(d, ray.slab.inverse.y);
  const auto oz = hn::Set(d, ray.slab.origin.z), iz = hn::Set(d, ray.slab.inverse.z);
  const auto px = hn::Mul(padding, hn::Set(d, ray.slope[0]));
  const auto py = hn::Mul(padding, hn::Set(d, ray.slope[1]));
  const auto pz = hn::Mul(padding, hn::Set(d, ray.slope[2]));
  const auto nx = hn::MulSub(hn::Sub(plane(ray.enter[0]), ox), ix, px);
  const auto ny = hn::MulSub(hn::Sub(plane(ray.enter[1]), oy), iy, py);
  const auto nz = hn::MulSub(hn::Sub(plane(ray.enter[2]), oz), iz, pz);
  const auto fx = hn::MulAdd(hn::Sub(plane(ray.enter[0] ^ 32), ox), ix, px);
  const auto fy = hn::MulAdd(hn::Sub(plane(ray.enter[1] ^ 32), oy), iy, py);
  const auto fz = hn::MulAdd(hn::Sub(plane(ray.enter[2] ^ 32), oz), iz, pz);
  const auto order = hn::SetTableIndices(d, kFarToNear[ray.slab.octant]);
  const auto near =
      hn::TableLookupLanes(hn::Max(hn::Max(nx, ny), hn::Max(nz, hn::Set(d, ray.t))), order);
  const auto far =
      hn::TableLookupLanes(hn::Min(hn::Min(fx, fy), hn::Min(fz, hn::Set(d, ray.tmax))), order);
  const auto child = hn::TableLookupLanes(hn::Load(du, node.child),
                                          hn::SetTableIndices(du, kFarToNear[ray.slab.octant]));
  const auto met = hn::Le(near, far);
  const std::uint32_t depth = ray.depth;
  hn::StoreU(hn::Compress(near, met), d, ray.stack_t + depth);
  hn::StoreU(hn::Compress(child, hn::RebindMask(du, met)), du, ray.stack_ref + depth);
  ray.depth = depth + static_cast<std::uint32_t>(hn::CountTrue(d, met));
}

// What a walk asks. take() is told of a triangle that is hit at tmin <= t <= tmax and returns true
// to end the walk; it does what the leaf functors of kernels/intersect.h do.
struct ClosestQuery {
  static HWY_ATTR HWY_INLINE bool take(const SceneView& scene, const RenderParams& params,
                                       WideRay& ray, const TriangleHit& found,
                                       std::uint32_t triangle, std::uint32_t flags,
                                       std::uint32_t geometry) {
    if (ray.hit.valid() && found.t == ray.hit.t && triangle > ray.hit.triangle) return false;
    if ((flags & kAlphaTest) != 0 && params.alpha != 0 &&
        !alpha_passes(scene, geometry, triangle, found.u, found.v)) {
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
  static HWY_ATTR HWY_INLINE bool take(const SceneView& scene, const RenderParams& params,
                                       WideRay& ray, const TriangleHit& found,
                                       std::uint32_t triangle, std::uint32_t flags,
                                       std::uint32_t geometry) {
    return dim(scene, params, {triangle, flags, geometry}, found, &ray.opacity);
  }
  static bool culls(const RenderParams&, std::uint32_t) { return false; }
};

// Tests the triangles of a leaf against the ray: the operations of intersect_triangle(), a triangle
// a lane. Triangles whose edge functions want double take that function itself.
// True: the walk is over.
template <class Query>
HWY_ATTR HWY_INLINE bool visit_leaf(const WideView& tree, const SceneView& scene,
                                    const RenderParams& params, WideRay& ray) {
  const Floats d;
  const std::uint32_t n = leaf_count(ray.ref);
  const float* rows = tree.leaves + std::uint64_t{leaf_first(ray.ref)} * kLeafRows;
  using V = hn::Vec<Floats>;
  const auto row = [&](std::uint32_t r) HWY_ATTR { return hn::LoadU(d, rows + r * n); };
  const V ox = hn::Set(d, ray.slab.origin.x);
  const V oy = hn::Set(d, ray.slab.origin.y);
  const V oz = hn::Set(d, ray.slab.origin.z);
  const V x_a = hn::Sub(row(0), ox), y_a = hn::Sub(row(1), oy), z_a = hn::Sub(row(2), oz);
  const V x_b = hn::Sub(row(3), ox), y_b = hn::Sub(row(4), oy), z_b = hn::Sub(row(5), oz);
  const V x_c = hn::Sub(row(6), ox), y_c = hn::Sub(row(7), oy), z_c = hn::Sub(row(8), oz);
  const auto shear8 = [&](const Vec3& by, V x, V y, V z) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, by.x), x,
                      hn::MulAdd(hn::Set(d, by.y), y, hn::Mul(hn::Set(d, by.z), z)));
  };
  const auto edge8 = [&](V ax, V ay, V bx, V by)
                         HWY_ATTR { return hn::Sub(hn::Mul(ax, by), hn::Mul(ay, bx)); };
  const V ax = shear8(ray.shear.row_x, x_a, y_a, z_a), ay = shear8(ray.shear.row_y, x_a, y_a, z_a);
  const V bx = shear8(ray.shear.row_x, x_b, y_b, z_b), by = shear8(ray.shear.row_y, x_b, y_b, z_b);
  const V cx = shear8(ray.shear.row_x, x_c, y_c, z_c), cy = shear8(ray.shear.row_y, x_c, y_c, z_c);
  const V wa = edge8(cx, cy, bx, by), wb = edge8(ax, ay, cx, cy), wc = edge8(bx, by, ax, ay);
  const V zero = hn::Zero(d);
  const V least = hn::Min(hn::Min(wa, wb), wc), most = hn::Max(hn::Max(wa, wb), wc);
  const auto mixed = hn::And(hn::Lt(least, zero), hn::Gt(most, zero));
  const auto bits_of = [&](auto mask) HWY_ATTR {
    std::uint8_t bits[8];
    hn::StoreMaskBits(d, mask, bits);
    return std::uint32_t{bits[0]};
  };
  const std::uint32_t candidates = ~bits_of(mixed) & ((1u << n) - 1u);
  if (candidates == 0) return false;

  const V det = hn::Add(hn::Add(wa, wb), wc);
  const V scaled = hn::Add(hn::Add(hn::Mul(wa, shear8(ray.shear.row_z, x_a, y_a, z_a)),
                                   hn::Mul(wb, shear8(ray.shear.row_z, x_b, y_b, z_b))),
                           hn::Mul(wc, shear8(ray.shear.row_z, x_c, y_c, z_c)));
  const V lx = hn::Sub(hn::Min(hn::Min(row(0), row(3)), row(6)), ox);
  const V ly = hn::Sub(hn::Min(hn::Min(row(1), row(4)), row(7)), oy);
  const V lz = hn::Sub(hn::Min(hn::Min(row(2), row(5)), row(8)), oz);
  const V ux = hn::Sub(hn::Max(hn::Max(row(0), row(3)), row(6)), ox);
  const V uy = hn::Sub(hn::Max(hn::Max(row(1), row(4)), row(7)), oy);
  const V uz = hn::Sub(hn::Max(hn::Max(row(2), row(5)), row(8)), oz);
  const V mx = hn::Max(hn::Abs(lx), hn::Abs(ux)), my = hn::Max(hn::Abs(ly), hn::Abs(uy));
  const V mz = hn::Max(hn::Abs(lz), hn::Abs(uz));
  const V padding = hn::Mul(hn::Max(hn::Max(mx, my), mz), hn::Set(d, kBoxPadding));
  const auto slab8 = [&](V lower, V upper, float inverse, V* near, V* far) HWY_ATTR {
    const V i = hn::Set(d, inverse);
    const auto negative = hn::Lt(i, zero);
    const V a = hn::Mul(hn::Sub(lower, padding), i), b = hn::Mul(hn::Add(upper, padding), i);
    *near = hn::IfThenElse(negative, b, a);
    *far = hn::IfThenElse(negative, a, b);
  };
  V near_x, near_y, near_z, far_x, far_y, far_z;
  slab8(lx, ux, ray.slab.inverse.x, &near_x, &far_x);
  slab8(ly, uy, ray.slab.inverse.y, &near_y, &far_y);
  slab8(lz, uz, ray.slab.inverse.z, &near_z, &far_z);
  const V near = hn::Max(hn::Max(near_x, near_y), near_z);
  const V far = hn::Min(hn::Min(far_x, far_y), far_z);
  const V t = hn::Min(hn::Max(hn::Div(scaled, det), near), far);
  const auto inside =
      hn::And(hn::And(hn::Le(near, far), hn::Ne(det, zero)),
              hn::And(hn::Ge(t, hn::Set(d, ray.tmin)), hn::Le(t, hn::Set(d, ray.tmax))));
  const V widest = hn::Max(hn::Max(hn::Abs(ax), hn::Abs(bx)), hn::Abs(cx));
  const V highest = hn::Max(hn::Max(hn::Abs(ay), hn::Abs(by)), hn::Abs(cy));
  const V thin = hn::Mul(hn::Mul(widest, highest), hn::Set(d, kThinTriangle));
  const auto exact = hn::Or(hn::Or(hn::Eq(wa, zero), hn::Eq(wb, zero)),
                            hn::Or(hn::Eq(wc, zero), hn::Lt(hn::Abs(det), thin)));
  // A t of zero, whose sign depends on how the compiler orders minima, is left to that function
  // too.
  const auto singly = hn::Or(exact, hn::Eq(t, zero));
  const std::uint32_t exact_bits = candidates & bits_of(singly);
  std::uint32_t hits = (candidates & bits_of(inside)) | exact_bits;
  if (hits == 0) return false;

  alignas(32) float ts[8], was[8], wbs[8], wcs[8], dets[8];
  hn::Store(t, d, ts);
  hn::Store(wa, d, was);
  hn::Store(wb, d, wbs);
  hn::Store(wc, d, wcs);
  hn::Store(det, d, dets);
  for (; hits != 0; hits &= hits - 1) {
    const auto i = static_cast<std::uint32_t>(lowest_bit(hits));
    const auto word = [&](std::uint32_t r) {
      std::uint32_t bits;
      __builtin_memcpy(&bits, &rows[r * n + i], sizeof bits);
      return bits;
    };
    const std::uint32_t flags = word(kRowFlags);
    const bool cull = Query::culls(params, flags);
    TriangleHit found;
    if ((exact_bits >> i) & 1) {
      const auto corner = [&](std::uint32_t r) {
        return Vec3(rows[r * n + i], rows[(r + 1) * n + i], rows[(r + 2) * n + i]);
      };
      if (!intersect_triangle(ray.slab, ray.shear, corner(0), corner(3), corner(6), ray.tmin,
                              ray.tmax, cull, &found)) {
        continue;
      }
    } else {
      const bool back = was[i] < 0.0f || wbs[i] < 0.0f || wcs[i] < 0.0f;
      if ((back && cull) || ts[i] > ray.tmax) continue;
      found = {ts[i], div_rn(wbs[i], dets[i]), div_rn(wcs[i], dets[i])};
    }
    if (Query::take(scene, params, ray, found, word(kRowTriangle), flags, word(kRowGeometry)))
      return true;
  }
  return false;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
