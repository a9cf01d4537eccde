// Axis-aligned boxes for builders, four floats wide so that compilers use SIMD registers.
#pragma once

#include <cstdint>
#include <limits>

#include "kernels/config.h"

namespace octrace::octree {

using Float4 = float __attribute__((vector_size(16)));

inline Float4 lesser(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 greater(Float4 a, Float4 b) { return a > b ? a : b; }
inline Float4 float4(const kernels::Vec3& v) { return Float4{v.x, v.y, v.z, 0.0f}; }

struct Box {
  Float4 lower{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
               std::numeric_limits<float>::infinity(), 0.0f};
  Float4 upper{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
               -std::numeric_limits<float>::infinity(), 0.0f};

  void add(Float4 point) {
    lower = lesser(lower, point);
    upper = greater(upper, point);
  }
  void add(const Box& other) {
    lower = lesser(lower, other.lower);
    upper = greater(upper, other.upper);
  }
  bool empty() const { return !(lower[0] <= upper[0]); }
  // Half the surface, which is what the heuristic's ratios need.
  float half_area() const {
    const Float4 d = upper - lower;
    return empty() ? 0.0f : d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
  }
  // Twice the centre: a sum rounds once, and builders only compare centres.
  Float4 centre2() const { return lower + upper; }
};

}  // namespace octrace::octree
