#include "tests/support/reference_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace octrace::tests {

using render::Aov;

Matrix reference_framing(const std::vector<ReferenceTriangle>& triangles, double yfov) {
  Real3 lower{1e30, 1e30, 1e30}, upper{-1e30, -1e30, -1e30};
  for (const ReferenceTriangle& triangle : triangles) {
    for (const Real3& corner : triangle.corners) {
      for (int a = 0; a < 3; ++a) {
        lower[a] = std::min(lower[a], corner[a]);
        upper[a] = std::max(upper[a], corner[a]);
      }
    }
  }
  double radius = 0.0;
  Real3 centre;
  for (int a = 0; a < 3; ++a) {
    centre[a] = 0.5 * (lower[a] + upper[a]);
    radius += 0.25 * (upper[a] - lower[a]) * (upper[a] - lower[a]);
  }
  radius = std::sqrt(radius);
  const double away = radius / std::sin(0.5 * yfov);
  const Real3 back{0.48, 0.36, 0.8};  // unit
  const double flat = std::sqrt(back[0] * back[0] + back[2] * back[2]);
  const Real3 right{back[2] / flat, 0.0, -back[0] / flat};
  const Real3 up{back[1] * right[2], back[2] * right[0] - back[0] * right[2], -back[1] * right[0]};
  return {right[0],
          right[1],
          right[2],
          0,
          up[0],
          up[1],
          up[2],
          0,
          back[0],
          back[1],
          back[2],
          0,
          centre[0] + away * back[0],
          centre[1] + away * back[1],
          centre[2] + away * back[2],
          1};
}

void compare_with_reference(const GltfReference::Frame& frame, const Matrix& camera, double yfov,
                            const render::Framebuffer& image, Tally& tally) {
  const auto width = static_cast<int>(image.width()), height = static_cast<int>(image.height());
  // A pixel is decided where growing and shrinking every triangle a little changes nothing.
  constexpr double kGrow = 1e-5;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const ReferenceRay ray = reference_ray(camera, yfov, width, height, x + 0.5, y + 0.5);
      const auto grown = reference_cast(frame.triangles, ray, kGrow);
      const auto shrunk = reference_cast(frame.triangles, ray, -kGrow);
      const auto pixel = static_cast<std::size_t>(y * width + x);
      ++tally.pixels;
      if (grown.has_value() != shrunk.has_value() ||
          (grown && std::abs(grown->depth - shrunk->depth) > 1e-7 * grown->depth)) {
        ++tally.undecided;
        continue;
      }
      const float depth = image.floats(Aov::depth)[pixel];
      ASSERT_EQ(image.floats(Aov::mask)[pixel], grown ? 1.0f : 0.0f) << "pixel " << x << ", " << y;
      if (!grown) continue;
      ++tally.hits;
      // A position that is off by a rounding moves the hit by more where the ray grazes.
      ASSERT_NEAR(depth, grown->depth, 1e-6 * grown->depth / grown->facing)
          << "pixel " << x << ", " << y;
      const std::uint32_t id = image.uints(Aov::object_id)[pixel];
      if (id != grown->node + 1) {  // only where two nodes' surfaces cross
        std::vector<ReferenceTriangle> of_id;
        std::copy_if(frame.triangles.begin(), frame.triangles.end(), std::back_inserter(of_id),
                     [&](const ReferenceTriangle& t) { return t.node + 1 == id; });
        const auto crossing = reference_cast(of_id, ray, kGrow);
        ASSERT_TRUE(crossing) << "pixel " << x << ", " << y;
        ASSERT_NEAR(crossing->depth, grown->depth,
                    1e-6 * grown->depth / std::min(grown->facing, crossing->facing));
        ++tally.undecided;
        continue;
      }
      const float* n = &image.floats(Aov::normal)[3 * pixel];
      const Real3& m = grown->normal;
      const double length = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
      if (length < 0.5) continue;
      ASSERT_NEAR(std::abs(n[0] * m[0] + n[1] * m[1] + n[2] * m[2]), 1.0, 1e-4)
          << "pixel " << x << ", " << y;
    }
  }
}

}  // namespace octrace::tests
