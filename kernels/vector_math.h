// The few vector operations that shading needs, in + - * / and square root only, which IEEE 754
// rounds alike on every device. Each sum has one written order, because contraction is off and
// reordering is not allowed.
#pragma once

#include <cmath>

#include "kernels/config.h"

namespace octrace::kernels {

inline constexpr float kPi = 3.14159265358979f;

// As ternaries, so that a NaN in `a` becomes `b` on every device.
OCTRACE_HD inline float min_of(float a, float b) { return a < b ? a : b; }
OCTRACE_HD inline float max_of(float a, float b) { return a > b ? a : b; }
OCTRACE_HD inline float clamp01(float x) { return min_of(max_of(x, 0.0f), 1.0f); }
OCTRACE_HD inline float magnitude(float x) { return x < 0.0f ? -x : x; }

OCTRACE_HD inline float square_root(float x) { return std::sqrt(x); }

OCTRACE_HD inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
OCTRACE_HD inline float dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
OCTRACE_HD inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
OCTRACE_HD inline float largest(Vec3 a) { return max_of(max_of(a.x, a.y), a.z); }
OCTRACE_HD inline float largest_magnitude(Vec3 a) {
  return max_of(max_of(magnitude(a.x), magnitude(a.y)), magnitude(a.z));
}
OCTRACE_HD inline float mean(Vec3 a) { return (a.x + a.y + a.z) * (1.0f / 3.0f); }

OCTRACE_HD inline bool is_finite(float x) { return x - x == 0.0f; }
OCTRACE_HD inline bool is_finite(Vec3 a) {
  return is_finite(a.x) && is_finite(a.y) && is_finite(a.z);
}

// Scaled by the largest component first, so that neither 1e-30 nor 1e30 leaves the range of float.
OCTRACE_HD inline float length(Vec3 a) {
  const float scale = largest_magnitude(a);
  if (!(scale > 0.0f) || !is_finite(scale)) return scale;
  const Vec3 s = a / scale;
  return scale * square_root(dot(s, s));
}

// Unit length; `fallback` where `a` has no direction (zero, infinite or not a number).
OCTRACE_HD inline Vec3 normalize_or(Vec3 a, Vec3 fallback) {
  const float scale = largest_magnitude(a);
  if (!(scale > 0.0f) || !is_finite(a)) return fallback;
  const Vec3 s = a / scale;
  return s / square_root(dot(s, s));
}

}  // namespace octrace::kernels
