// The few vector operations that shading needs, in + - * / and square root only, which IEEE 754
// rounds alike on every device. Each sum has one written order, because contraction is off and
// reordering is not allowed.
#pragma once

#include <cmath>

#include "kernels/config.h"
#include "kernels/round.h"

namespace octrace::kernels {

inline constexpr float kPi = 3.14159265358979f;

// NaN becomes 0: lesser() and greater() return their second argument then.
OCTRACE_HD inline float clamp01(float x) { return lesser(greater(x, 0.0f), 1.0f); }
OCTRACE_HD inline float square_root(float x) { return std::sqrt(x); }

OCTRACE_HD inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
OCTRACE_HD inline float dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
OCTRACE_HD inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
OCTRACE_HD inline float largest(Vec3 a) { return greater(greater(a.x, a.y), a.z); }
OCTRACE_HD inline float largest_magnitude(Vec3 a) {
  return greater(greater(abs_of(a.x), abs_of(a.y)), abs_of(a.z));
}

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
