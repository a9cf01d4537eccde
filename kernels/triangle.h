// The watertight ray/triangle test of Woop, Benthin and Wald 2013 ("Watertight Ray/Triangle
// Intersection"), with fixed roundings.
//
// Corners are moved to the ray's origin and sheared so that the ray becomes the z axis; the signs
// of three 2D edge functions then decide. A product of two floats rounds monotonically, so the sign
// of a difference of two products is right or the difference is zero; zeros are computed again in
// double, where the products are exact. Hence triangles that share an edge never leave a gap.
//
// t is clamped into the slab interval of the triangle's own box: see box.h for why.
//
// Nor does a hit stray from its triangle, because octrees list a large triangle in several leaves,
// each with the box of a part of it. An edge function is off by at most 2^-22 B, where B bounds the
// products in it; so where the determinant is at least 2^-8 B, weights are off by at most 2^-12
// altogether, and the hit lies within 2^-11 of the triangle's longest side from the triangle
// (beside the roundings of the corners, which the padding of boxes covers). Below that, rays see
// the triangle nearly edge-on, and the edge functions are computed in double.
#pragma once

#include "kernels/box.h"
#include "kernels/ray.h"
#include "kernels/round.h"

namespace octrace::kernels {

// A ray prepared for triangle tests: rows of the shear. Each row has a 1 or a scale in one place
// and a 0 in another, so a dot product by fma needs no permutation of the corner and rounds the
// same for every triangle of this ray, which is what watertightness asks for.
struct TriangleRay {
  Vec3 row_x, row_y, row_z;
};

// The direction's largest axis k becomes z. Chosen before anything is divided, so that the lanes of
// a warp divide together.
OCTRACE_HD OCTRACE_FORCE_INLINE TriangleRay make_triangle_ray(const Vec3& d) {
  const float ax = abs_of(d.x), ay = abs_of(d.y), az = abs_of(d.z);
  const bool is_z = az >= ax && az >= ay;
  const bool is_y = !is_z && ay >= ax;
  const auto pick = [&](float if_x, float if_y, float if_z) {
    return is_z ? if_z : is_y ? if_y : if_x;
  };
  const float dk = pick(d.x, d.y, d.z);
  const float i = -div_rn(pick(d.y, d.z, d.x), dk);
  const float j = -div_rn(pick(d.z, d.x, d.y), dk);
  const float r = reciprocal_rn(dk);
  const Vec3 x(pick(i, 0.0f, 1.0f), pick(1.0f, i, 0.0f), pick(0.0f, 1.0f, i));
  const Vec3 y(pick(j, 1.0f, 0.0f), pick(0.0f, j, 1.0f), pick(1.0f, 0.0f, j));
  const Vec3 z(pick(r, 0.0f, 0.0f), pick(0.0f, r, 0.0f), pick(0.0f, 0.0f, r));
  // Swapped rows keep the winding: a front face has a positive determinant.
  return dk < 0.0f ? TriangleRay{y, x, z} : TriangleRay{x, y, z};
}

OCTRACE_HD OCTRACE_FORCE_INLINE float shear(const Vec3& row, const Vec3& v) {
  return fma_rn(row.x, v.x, fma_rn(row.y, v.y, mul_rn(row.z, v.z)));
}

OCTRACE_HD OCTRACE_FORCE_INLINE Vec3 relative_to(const Vec3& corner, const Vec3& origin) {
  return Vec3(sub_rn(corner.x, origin.x), sub_rn(corner.y, origin.y), sub_rn(corner.z, origin.z));
}

OCTRACE_HD OCTRACE_FORCE_INLINE float edge(float ax, float ay, float bx, float by) {
  return sub_rn(mul_rn(ax, by), mul_rn(ay, bx));
}

OCTRACE_HD inline float exact_edge(float ax, float ay, float bx, float by) {
  return static_cast<float>(sub_rn(mul_rn(static_cast<double>(ax), static_cast<double>(by)),
                                   mul_rn(static_cast<double>(ay), static_cast<double>(bx))));
}

// Determinants below this share of the largest product are computed again, exactly.
inline constexpr float kThinTriangle = 1.0f / (1 << 8);

struct TriangleHit {
  float t, u, v;  // u, v: weights of the second and third corner
};

// Does the ray hit the triangle a, b, c with tmin <= t <= tmax? cull_back: counter-clockwise seen
// from the origin only. Degenerate triangles are never hit.
OCTRACE_HD OCTRACE_FORCE_INLINE bool intersect_triangle(const SlabRay& slab_ray,
                                                        const TriangleRay& ray, const Vec3& a,
                                                        const Vec3& b, const Vec3& c, float tmin,
                                                        float tmax, bool cull_back,
                                                        TriangleHit* hit) {
  const Vec3 ra = relative_to(a, slab_ray.origin);
  const Vec3 rb = relative_to(b, slab_ray.origin);
  const Vec3 rc = relative_to(c, slab_ray.origin);
  const float ax = shear(ray.row_x, ra), ay = shear(ray.row_y, ra);
  const float bx = shear(ray.row_x, rb), by = shear(ray.row_y, rb);
  const float cx = shear(ray.row_x, rc), cy = shear(ray.row_y, rc);
  float wa = edge(cx, cy, bx, by);
  float wb = edge(ax, ay, cx, cy);
  float wc = edge(bx, by, ax, ay);
  if (wa == 0.0f || wb == 0.0f || wc == 0.0f) {
    wa = exact_edge(cx, cy, bx, by);
    wb = exact_edge(ax, ay, cx, cy);
    wc = exact_edge(bx, by, ax, ay);
  }
  const bool any_negative = wa < 0.0f || wb < 0.0f || wc < 0.0f;
  const bool any_positive = wa > 0.0f || wb > 0.0f || wc > 0.0f;
  if (any_negative && (any_positive || cull_back)) return false;
  float determinant = add_rn(add_rn(wa, wb), wc);
  if (determinant == 0.0f) return false;
  const float widest = most(most(abs_of(ax), abs_of(bx)), abs_of(cx));
  const float highest = most(most(abs_of(ay), abs_of(by)), abs_of(cy));
  if (abs_of(determinant) < mul_rn(mul_rn(widest, highest), kThinTriangle)) {
    wa = exact_edge(cx, cy, bx, by);
    wb = exact_edge(ax, ay, cx, cy);
    wc = exact_edge(bx, by, ax, ay);
    determinant = add_rn(add_rn(wa, wb), wc);
  }

  const float scaled =
      add_rn(add_rn(mul_rn(wa, shear(ray.row_z, ra)), mul_rn(wb, shear(ray.row_z, rb))),
             mul_rn(wc, shear(ray.row_z, rc)));
  // Rounding is monotone, so these are the bounds of a, b and c, moved to the origin.
  const Vec3 lower(least(least(ra.x, rb.x), rc.x), least(least(ra.y, rb.y), rc.y),
                   least(least(ra.z, rb.z), rc.z));
  const Vec3 upper(most(most(ra.x, rb.x), rc.x), most(most(ra.y, rb.y), rc.y),
                   most(most(ra.z, rb.z), rc.z));
  const Interval interval = slab(lower, upper, slab_ray.inverse);
  if (!(interval.near <= interval.far)) return false;
  // The sum makes a zero positive, whatever the signs of zero above.
  const float t =
      add_rn(least(most(div_rn(scaled, determinant), interval.near), interval.far), 0.0f);
  if (!(t >= tmin && t <= tmax)) return false;
  *hit = {t, div_rn(wb, determinant), div_rn(wc, determinant)};
  return true;
}

}  // namespace octrace::kernels
