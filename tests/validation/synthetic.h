// Images with known answers: a plane z(x, y) seen through a disc.
#pragma once

#include <cmath>
#include <functional>
#include <limits>

#include "validation/compare/planes.h"

namespace octrace::validation::test {

inline constexpr std::uint32_t kWidth = 160, kHeight = 120;

// A disc of the given centre and radius, in pixels, at the depths that `depth` gives.
inline Planes disc(double cx, double cy, double radius,
                   const std::function<double(double, double)>& depth) {
  Planes planes;
  planes.width = kWidth;
  planes.height = kHeight;
  planes.mask.resize(kWidth * kHeight);
  planes.z.assign(kWidth * kHeight, std::numeric_limits<float>::infinity());
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      if (std::hypot(x + 0.5 - cx, y + 0.5 - cy) > radius) continue;
      planes.mask[y * kWidth + x] = 1;
      planes.z[y * kWidth + x] = static_cast<float>(depth(x + 0.5, y + 0.5));
    }
  }
  return planes;
}

inline Planes disc() {
  return disc(80, 60, 40, [](double x, double y) { return 5.0 + 0.001 * x + 0.002 * y; });
}

inline std::size_t at(std::uint32_t x, std::uint32_t y) { return std::size_t{y} * kWidth + x; }

inline void erase(Planes& planes, std::uint32_t x, std::uint32_t y) {
  planes.mask[at(x, y)] = 0;
  planes.z[at(x, y)] = std::numeric_limits<float>::infinity();
}

}  // namespace octrace::validation::test
