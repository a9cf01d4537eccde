// The slab test, conservative by construction (after Kay and Kajiya 1986; padding after Ize 2013,
// "Robust BVH ray traversal").
//
// Why the padding: a hit must not depend on the tree. Let M be the largest distance along an axis
// from the ray's origin to the box. slab() widens a box by M * 2^-20 on every side. Every operation
// in it is monotone under rounding, so a box inside another gets an interval inside the other's.
// child_slab() computes the same from quantised children with other roundings, at most
// 7 * 2^-24 * M away, and widens by M * 2^-19: its interval holds that of every triangle's own box
// below it. The triangle test clamps t into the slab() interval of the triangle's box
// (triangle.h), so no node on the way to a hit can be missed, whatever the builder.
#pragma once

#include "kernels/node.h"
#include "kernels/ray.h"
#include "kernels/round.h"

namespace octrace::kernels {

struct Interval {
  float near, far;  // empty where near > far
};

inline constexpr float kBoxPadding = 1.0f / (1 << 20);
inline constexpr float kChildPadding = 1.0f / (1 << 19);

// A ray prepared for slab tests.
struct SlabRay {
  Vec3 origin;
  std::uint32_t octant;  // bit a: direction is negative along axis a
  Vec3 inverse;          // 1 / direction, finite
  float unused = 0.0f;   // so that SIMD loads of four stay inside
};

// Directions count as no closer to zero than 2^-80, which keeps 1/d and its products with
// coordinates below kMaxCoordinate finite, and which the padding covers: over the box's distance a
// ray strays from the axis plane by less than 2^-50 of it.
inline constexpr float kTinyDirection = 8.271806125530277e-25f;  // 2^-80

OCTRACE_HD OCTRACE_FORCE_INLINE float safe_inverse(float d) {
  if (abs_of(d) < kTinyDirection) d = d < 0.0f ? -kTinyDirection : kTinyDirection;
  return reciprocal_rn(d);
}

OCTRACE_HD OCTRACE_FORCE_INLINE SlabRay make_slab_ray(const Ray& ray) {
  const Vec3 d = ray.direction;
  return {ray.origin, (d.x < 0.0f ? 1u : 0u) | (d.y < 0.0f ? 2u : 0u) | (d.z < 0.0f ? 4u : 0u),
          Vec3(safe_inverse(d.x), safe_inverse(d.y), safe_inverse(d.z))};
}

OCTRACE_HD OCTRACE_FORCE_INLINE Interval slab_axis(float lower, float upper, float padding,
                                                   float inverse) {
  const float a = mul_rn(sub_rn(lower, padding), inverse);
  const float b = mul_rn(add_rn(upper, padding), inverse);
  return {least(a, b), most(a, b)};
}

// Where along the ray the box lies, never too narrow. Its corners are relative to the ray's origin.
OCTRACE_HD OCTRACE_FORCE_INLINE Interval slab(const Vec3& lower, const Vec3& upper,
                                              const Vec3& inverse) {
  const float mx = most(abs_of(lower.x), abs_of(upper.x));
  const float my = most(abs_of(lower.y), abs_of(upper.y));
  const float mz = most(abs_of(lower.z), abs_of(upper.z));
  const float padding = mul_rn(most(most(mx, my), mz), kBoxPadding);
  const Interval x = slab_axis(lower.x, upper.x, padding, inverse.x);
  const Interval y = slab_axis(lower.y, upper.y, padding, inverse.y);
  const Interval z = slab_axis(lower.z, upper.z, padding, inverse.z);
  return {most(most(x.near, y.near), z.near), least(least(x.far, y.far), z.far)};
}

// A node's frame in the ray's terms: a child's plane q along axis a lies at t = q * step[a] +
// near[a] where it is entered and q * step[a] + far[a] where it is left.
struct NodeFrame {
  Vec3 step, near, far;
};

OCTRACE_HD OCTRACE_FORCE_INLINE float power_of_two(std::int8_t exponent) {
  const std::uint32_t bits = static_cast<std::uint32_t>(exponent + 127) << 23;
#if defined(__CUDA_ARCH__)
  return __uint_as_float(bits);
#else
  float value;
  __builtin_memcpy(&value, &bits, sizeof value);
  return value;
#endif
}

OCTRACE_HD OCTRACE_FORCE_INLINE NodeFrame node_frame(const Node& node, const SlabRay& ray) {
  const Vec3 scale(power_of_two(node.exponent[0]), power_of_two(node.exponent[1]),
                   power_of_two(node.exponent[2]));
  const Vec3 l(node.origin[0] - ray.origin.x, node.origin[1] - ray.origin.y,
               node.origin[2] - ray.origin.z);
  const Vec3 u(l.x + 255.0f * scale.x, l.y + 255.0f * scale.y, l.z + 255.0f * scale.z);
  const float mx = greater(abs_of(l.x), abs_of(u.x));
  const float my = greater(abs_of(l.y), abs_of(u.y));
  const float mz = greater(abs_of(l.z), abs_of(u.z));
  const float padding = greater(greater(mx, my), mz) * kChildPadding;
  const Vec3 i = ray.inverse;
  const Vec3 base(l.x * i.x, l.y * i.y, l.z * i.z);
  const Vec3 widen(padding * abs_of(i.x), padding * abs_of(i.y), padding * abs_of(i.z));
  return {Vec3(scale.x * i.x, scale.y * i.y, scale.z * i.z), base - widen, base + widen};
}

}  // namespace octrace::kernels
