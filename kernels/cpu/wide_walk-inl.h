// A ray's walk over the wide nodes, a node at a time. Included once for each instruction set,
// between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE of the file that includes it.
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

HWY_ATTR HWY_INLINE std::uint32_t bits_of(hn::Mask<Floats> mask) {
  std::uint8_t bits[8];
  hn::StoreMaskBits(Floats(), mask, bits);
  return bits[0];
}

// Moves the lanes of a mask to the front; what comes behind them is left open.
#if HWY_TARGET == HWY_AVX2
// Not by hn::Compress(), for which GCC copies a table of 1 KB to the stack each time.
struct FrontTable {
  std::uint32_t places[256] = {};  // four bits a lane: where it comes from
  constexpr FrontTable() {
    for (unsigned mask = 0; mask < 256; ++mask) {
      unsigned shift = 0;
      for (unsigned lane = 0; lane < 8; ++lane) {
        if ((mask >> lane) & 1u) {
          places[mask] |= lane << shift;
          shift += 4;
        }
      }
    }
  }
};
inline constexpr FrontTable kFrontTable;

class ToFront {
 public:
  HWY_ATTR HWY_INLINE explicit ToFront(hn::Mask<Floats> mask) {
    const Words du;
    const auto shifts = hn::ShiftLeft<2>(hn::Iota(du, 0));
    const auto places = hn::Shr(hn::Set(du, kFrontTable.places[bits_of(mask)]), shifts);
    from_ = hn::And(places, hn::Set(du, 7u));
  }
  template <class V>
  HWY_ATTR HWY_INLINE V operator()(V v) const {
    return hn::TableLookupLanes(v, hn::IndicesFromVec(hn::DFromV<V>(), from_));
  }

 private:
  hn::Vec<Words> from_;
};
#else
class ToFront {
 public:
  HWY_ATTR HWY_INLINE explicit ToFront(hn::Mask<Floats> mask) : mask_(mask) {}
  HWY_ATTR HWY_INLINE hn::Vec<Floats> operator()(hn::Vec<Floats> v) const {
    return hn::Compress(v, mask_);
  }
  HWY_ATTR HWY_INLINE hn::Vec<Words> operator()(hn::Vec<Words> v) const {
    return hn::Compress(v, hn::RebindMask(Words(), mask_));
  }

 private:
  hn::Mask<Floats> mask_;
};
#endif

// What a ray has found.
struct RayState {
  Hit hit;
  float tmax;
  std::uint32_t opacity;
};

struct alignas(64) WideRay : RayState {
  // A plane p of an axis is met at p * inverse + base - t * spread where a box is entered, at
  // p * inverse + base + t * spread where it is left: three lanes for each, the fourth is unused.
  alignas(32) float base[8], spread[8];
  Vec3 inverse;
  std::uint32_t enter[3];  // where a node keeps the planes that are entered, in bytes
  // What comes next, and where along the ray it begins.
  WideRef ref;
  float t;
  std::uint32_t depth;  // entries on the stack
  std::uint32_t candidates;
  // For leaves.
  Vec3 direction;
  float largest;      // component of the direction
  float edge, plane;  // how far the quick test may be wrong: see candidates()
  float ahead;
  float tmin;
  SlabRay slab;
  TriangleRay shear;
  std::uint32_t index;
  alignas(64) float stack_t[kWideStack];
  alignas(64) WideRef stack_ref[kWideStack];

  OCTRACE_FORCE_INLINE void pop() {
    --depth;
    ref = stack_ref[depth];
    t = stack_t[depth];
  }
  OCTRACE_FORCE_INLINE void finish() { ref = kDoneRef; }
};

HWY_ATTR HWY_INLINE void prefetch(const WideView& tree, WideRef ref) {
  const char* from = reinterpret_cast<const char*>(tree.at(ref));
  __builtin_prefetch(from);
  __builtin_prefetch(from + 64);
  __builtin_prefetch(from + 128);
  __builtin_prefetch(from + 192);
}

HWY_ATTR HWY_INLINE void begin(const WideView& tree, const Ray& from, std::uint32_t index,
                               WideRay& ray) {
  ray.slab = make_slab_ray(from);
  ray.shear = make_triangle_ray(from.direction);
  ray.inverse = ray.slab.inverse;
  ray.direction = from.direction;
  ray.tmin = from.tmin;
  ray.tmax = from.tmax;
  ray.index = index;
  ray.opacity = 0;
  ray.hit = {from.tmax, 0.0f, 0.0f, kNone};
  ray.stack_t[0] = -std::numeric_limits<float>::infinity();
  ray.stack_ref[0] = kDoneRef;
  ray.depth = 1;
  ray.finish();
  float largest = 0.0f, farthest = 0.0f;
  Vec3 a, b;
  for (int axis = 0; axis < 3; ++axis) {
    a[axis] = tree.lower[axis] - from.origin[axis];
    b[axis] = tree.upper[axis] - from.origin[axis];
    largest = greater(largest, abs_of(from.direction[axis]));
    farthest = greater(farthest, greater(abs_of(a[axis]), abs_of(b[axis])));
  }
  const float padding = farthest * kChildPadding;
  float near = from.tmin, far = from.tmax;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.slab.inverse[axis], slope = abs_of(inverse);
    const float enter = a[axis] * inverse, leave = b[axis] * inverse;
    near = greater(near, lesser(enter, leave) - padding * slope);
    far = lesser(far, greater(enter, leave) + padding * slope);
    const float base = -from.origin[axis] * inverse;
    const float lost = abs_of(base) * 0x1p-22f;
    const float spread = largest * kChildPadding * slope;
    ray.base[axis] = base - lost;
    ray.base[axis + 4] = base + lost;
    ray.spread[axis] = -spread;
    ray.spread[axis + 4] = spread;
    ray.enter[axis] = static_cast<std::uint32_t>(axis) * 64 + ((ray.slab.octant >> axis) & 1u) * 32;
  }
  ray.base[3] = ray.base[7] = ray.spread[3] = ray.spread[7] = 0.0f;
  ray.largest = largest;
  ray.ahead = 0x1p-11f / largest;
  // Where its products might overflow, the quick test passes everything.
  const bool sane = farthest * farthest * greater(farthest, largest) < 1e30f;
  ray.edge = sane ? largest * 0x1p-16f : std::numeric_limits<float>::infinity();
  ray.plane = sane ? 0x1p-15f : std::numeric_limits<float>::infinity();
  if (!(near <= far)) return;
  ray.ref = 0;
  ray.t = near;
}

// Goes on to a child that the ray meets, the nearest one if kNearest, and puts the others on the
// stack; or takes what comes next from there. Of the others the order is left open: on the
// benchmarks' bounce rays the nearest first saves as many nodes as sorting all of them, less 0 to
// 6 %, and queries for any hit are best off without an order.
template <bool kNearest>
HWY_ATTR HWY_INLINE void visit_node(const WideView& tree, WideRay& ray) {
  const Floats d;
  const Words du;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(tree.at(ray.ref));
  const auto plane = [&](std::uint32_t offset) HWY_ATTR {
    return hn::Load(d, reinterpret_cast<const float*>(bytes + offset));
  };
  const auto t = hn::Set(d, ray.t);
  alignas(32) float base[8];
  hn::Store(hn::MulAdd(t, hn::Load(d, ray.spread), hn::Load(d, ray.base)), d, base);
  const std::uint32_t ex = ray.enter[0], ey = ray.enter[1], ez = ray.enter[2];
  const auto ix = hn::Set(d, ray.inverse.x), iy = hn::Set(d, ray.inverse.y);
  const auto iz = hn::Set(d, ray.inverse.z);
  const auto nx = hn::MulAdd(plane(ex), ix, hn::Set(d, base[0]));
  const auto ny = hn::MulAdd(plane(ey), iy, hn::Set(d, base[1]));
  const auto nz = hn::MulAdd(plane(ez), iz, hn::Set(d, base[2]));
  const auto fx = hn::MulAdd(plane(ex ^ 32), ix, hn::Set(d, base[4]));
  const auto fy = hn::MulAdd(plane(ey ^ 32), iy, hn::Set(d, base[5]));
  const auto fz = hn::MulAdd(plane(ez ^ 32), iz, hn::Set(d, base[6]));
  const auto near = hn::Max(hn::Max(nx, ny), hn::Max(nz, t));
  const auto far = hn::Min(hn::Min(fx, fy), hn::Min(fz, hn::Set(d, ray.tmax)));
  const auto* children = reinterpret_cast<const WideRef*>(bytes + sizeof(WideNode::planes));
  const auto met = hn::Le(near, far);
  const std::uint32_t depth = ray.depth;
  const auto count = static_cast<std::uint32_t>(hn::CountTrue(d, met));
  const auto child = hn::Load(du, children);
  if constexpr (kNearest) {
    // The three lowest bits of a distance make way for the slot, so that no two are equal; where
    // the ray begins in several boxes the last slot comes first.
    const auto slots = hn::Sub(hn::Set(du, 7), hn::Iota(du, 0));
    const auto clear = hn::Set(du, ~7u);
    const auto key =
        hn::IfThenElse(met, hn::BitCast(d, hn::Or(hn::And(hn::BitCast(du, near), clear), slots)),
                       hn::Set(d, std::numeric_limits<float>::max()));
    const auto least = hn::MinOfLanes(d, key);
    const auto others = hn::AndNot(hn::Eq(key, least), met);
    const float first_t = hn::GetLane(hn::BitCast(d, hn::And(hn::BitCast(du, least), clear)));
    const WideRef first = children[~hn::GetLane(hn::BitCast(du, least)) & 7u];
    const WideRef top = ray.stack_ref[depth - 1];
    const float top_t = ray.stack_t[depth - 1];
    ray.ref = count != 0 ? first : top;
    ray.t = count != 0 ? first_t : top_t;
    const ToFront front(others);
    hn::StoreU(front(near), d, ray.stack_t + depth);
    hn::StoreU(front(child), du, ray.stack_ref + depth);
    ray.depth = depth + count - 1;
  } else {
    const ToFront front(met);
    hn::StoreU(front(near), d, ray.stack_t + depth);
    hn::StoreU(front(child), du, ray.stack_ref + depth);
    ray.depth = depth + count;
    ray.pop();
  }
}

// Takes the entries that begin after tmax off the stack. Its bottom begins at -infinity.
HWY_ATTR HWY_INLINE void drop_far(WideRay& ray) {
  const Floats d;
  const Words du;
  const std::uint32_t depth = ray.depth;
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < depth; i += 8) {
    const auto t = hn::Load(d, ray.stack_t + i);
    const auto ref = hn::Load(du, ray.stack_ref + i);
    const auto near = hn::And(hn::Le(t, hn::Set(d, ray.tmax)), hn::FirstN(d, depth - i));
    const ToFront front(near);
    hn::StoreU(front(t), d, ray.stack_t + kept);
    hn::StoreU(front(ref), du, ray.stack_ref + kept);
    kept += static_cast<std::uint32_t>(hn::CountTrue(d, near));
  }
  ray.depth = kept;
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
