// kernels/triangle.h for eight lanes, a ray and a triangle each: the same bits, but for lanes that
// it leaves to intersect_triangle(). Included once for each instruction set.
#if defined(OCTRACE_TRIANGLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_TRIANGLE_LANES_INL
#undef OCTRACE_TRIANGLE_LANES_INL
#else
#define OCTRACE_TRIANGLE_LANES_INL
#endif

#include "kernels/cpu/wide_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

struct ShearLanes {
  hn::Vec<Floats> row_x[3], row_y[3], row_z[3];
};

// make_triangle_ray().
HWY_ATTR HWY_INLINE ShearLanes make_shear(const hn::Vec<Floats>* direction) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V ax = hn::Abs(direction[0]), ay = hn::Abs(direction[1]), az = hn::Abs(direction[2]);
  const auto z = hn::And(hn::Ge(az, ax), hn::Ge(az, ay));
  const auto y = hn::Ge(ay, ax);  // where not z
  const auto pick = [&](V if_x, V if_y, V if_z)
                        HWY_ATTR { return hn::IfThenElse(z, if_z, hn::IfThenElse(y, if_y, if_x)); };
  const V dk = pick(direction[0], direction[1], direction[2]);
  const V i = hn::Neg(hn::Div(pick(direction[1], direction[2], direction[0]), dk));
  const V j = hn::Neg(hn::Div(pick(direction[2], direction[0], direction[1]), dk));
  const V r = hn::Div(one, dk);
  const V x_row[3] = {pick(i, zero, one), pick(one, i, zero), pick(zero, one, i)};
  const V y_row[3] = {pick(j, one, zero), pick(zero, j, one), pick(one, zero, j)};
  const auto negative = hn::Lt(dk, zero);
  ShearLanes shear = {{}, {}, {pick(r, zero, zero), pick(zero, r, zero), pick(zero, zero, r)}};
  for (int axis = 0; axis < 3; ++axis) {
    shear.row_x[axis] = hn::IfThenElse(negative, y_row[axis], x_row[axis]);
    shear.row_y[axis] = hn::IfThenElse(negative, x_row[axis], y_row[axis]);
  }
  return shear;
}

struct RayLanes {
  hn::Vec<Floats> origin[3], inverse[3];
  ShearLanes shear;
};

struct TriangleLanes {
  hn::Vec<Floats> a[3], b[3], c[3];
  hn::Mask<Floats> cull;
};

// u is weight_b / determinant, v is weight_c / determinant. Whether t lies in the ray's range is
// left to the caller.
struct HitLanes {
  hn::Mask<Floats> hit, unsure;
  hn::Vec<Floats> t, weight_b, weight_c, determinant;
};

HWY_ATTR HWY_INLINE HitLanes intersect_lanes(const RayLanes& ray, const TriangleLanes& of) {
  const Floats d;
  using V = hn::Vec<Floats>;
  const auto shear8 = [&](const V* row, const V* p) HWY_ATTR {
    return hn::MulAdd(row[0], p[0], hn::MulAdd(row[1], p[1], hn::Mul(row[2], p[2])));
  };
  const auto edge8 = [&](V ax, V ay, V bx, V by)
                         HWY_ATTR { return hn::Sub(hn::Mul(ax, by), hn::Mul(ay, bx)); };
  V a[3], b[3], c[3];
  for (int axis = 0; axis < 3; ++axis) {
    a[axis] = hn::Sub(of.a[axis], ray.origin[axis]);
    b[axis] = hn::Sub(of.b[axis], ray.origin[axis]);
    c[axis] = hn::Sub(of.c[axis], ray.origin[axis]);
  }
  const V ax = shear8(ray.shear.row_x, a), ay = shear8(ray.shear.row_y, a);
  const V bx = shear8(ray.shear.row_x, b), by = shear8(ray.shear.row_y, b);
  const V cx = shear8(ray.shear.row_x, c), cy = shear8(ray.shear.row_y, c);
  const V wa = edge8(cx, cy, bx, by), wb = edge8(ax, ay, cx, cy), wc = edge8(bx, by, ax, ay);
  const V zero = hn::Zero(d);
  const V least = hn::Min(hn::Min(wa, wb), wc), most = hn::Max(hn::Max(wa, wb), wc);
  const auto mixed = hn::And(hn::Lt(least, zero), hn::Gt(most, zero));
  const V determinant = hn::Add(hn::Add(wa, wb), wc);
  const auto none = hn::Lt(zero, zero);
  if (hn::AllTrue(d, mixed)) return {none, none, zero, wb, wc, determinant};

  const V scaled = hn::Add(
      hn::Add(hn::Mul(wa, shear8(ray.shear.row_z, a)), hn::Mul(wb, shear8(ray.shear.row_z, b))),
      hn::Mul(wc, shear8(ray.shear.row_z, c)));
  const V widest = hn::Max(hn::Max(hn::Abs(ax), hn::Abs(bx)), hn::Abs(cx));
  const V highest = hn::Max(hn::Max(hn::Abs(ay), hn::Abs(by)), hn::Abs(cy));
  const V thin = hn::Mul(hn::Mul(widest, highest), hn::Set(d, kThinTriangle));
  V lower[3], upper[3], farthest = zero;
  for (int axis = 0; axis < 3; ++axis) {
    lower[axis] = hn::Min(hn::Min(a[axis], b[axis]), c[axis]);
    upper[axis] = hn::Max(hn::Max(a[axis], b[axis]), c[axis]);
    farthest = hn::Max(farthest, hn::Max(hn::Abs(lower[axis]), hn::Abs(upper[axis])));
  }
  const V padding = hn::Mul(farthest, hn::Set(d, kBoxPadding));
  V nears[3], fars[3];
  for (int axis = 0; axis < 3; ++axis) {
    const V enter = hn::Mul(hn::Sub(lower[axis], padding), ray.inverse[axis]);
    const V leave = hn::Mul(hn::Add(upper[axis], padding), ray.inverse[axis]);
    nears[axis] = hn::Min(enter, leave);
    fars[axis] = hn::Max(enter, leave);
  }
  const V near = hn::Max(hn::Max(nears[0], nears[1]), nears[2]);
  const V far = hn::Min(hn::Min(fars[0], fars[1]), fars[2]);
  const V t = hn::Min(hn::Max(hn::Div(scaled, determinant), near), far);
  const auto on_edge = hn::Or(hn::Or(hn::Eq(wa, zero), hn::Eq(wb, zero)), hn::Eq(wc, zero));
  const auto unsure = hn::AndNot(
      mixed, hn::Or(hn::Or(on_edge, hn::Eq(t, zero)), hn::Lt(hn::Abs(determinant), thin)));
  auto hit = hn::AndNot(unsure, hn::AndNot(mixed, hn::Le(near, far)));
  hit = hn::AndNot(hn::And(of.cull, hn::Lt(least, zero)), hit);
  return {hit, unsure, t, wb, wc, determinant};
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
