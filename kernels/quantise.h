// How a node's frame and its children's boxes are rounded to eight bits an axis: always outwards.
// One text for the builders of every device.
#pragma once

#include <cmath>

#include "kernels/config.h"

namespace octrace::kernels {

// Smaller steps would make products in the slab test underflow; a box that small is a point anyway.
inline constexpr int kMinExponent = -60;

// The smallest exponent whose 255 steps from the origin reach the extent.
OCTRACE_HD inline std::int8_t exponent_for(double origin, double end) {
  const double extent = end - origin;
  int exponent = kMinExponent;
  if (extent > 0.0) {
    frexp(extent / 255.0, &exponent);
    exponent = exponent < kMinExponent ? kMinExponent : exponent;
    // frexp gives a power of two above the quotient; one less may do, and is tried first.
    if (exponent > kMinExponent && origin + ldexp(255.0, exponent - 1) >= end) --exponent;
  }
  return static_cast<std::int8_t>(exponent);
}

OCTRACE_HD inline double clamp_step(double q) { return q < 0.0 ? 0.0 : q > 255.0 ? 255.0 : q; }

OCTRACE_HD inline std::uint8_t step_below(double origin, double scale, double value) {
  double q = clamp_step(floor((value - origin) / scale));
  while (q > 0.0 && origin + q * scale > value) q -= 1.0;
  return static_cast<std::uint8_t>(q);
}

OCTRACE_HD inline std::uint8_t step_above(double origin, double scale, double value) {
  double q = clamp_step(ceil((value - origin) / scale));
  while (q < 255.0 && origin + q * scale < value) q += 1.0;
  return static_cast<std::uint8_t>(q);
}

}  // namespace octrace::kernels
