// A hit lies on its triangle, also where the ray sees the triangle edge-on: octrees that list a
// triangle in several leaves, each with the box of a part, rely on it (kernels/triangle.h).
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "kernels/triangle.h"
#include "tests/support/intensity.h"

namespace octrace::tests {
namespace {

using glm::dvec3;
using kernels::Vec3;

// Ericson 2004, "Real-time collision detection", 5.1.5.
double distance(const dvec3& p, const dvec3& a, const dvec3& b, const dvec3& c) {
  const auto to_segment = [&](const dvec3& s, const dvec3& e) {
    const dvec3 d = e - s;
    const double length = glm::dot(d, d);
    const double at = length > 0.0 ? glm::clamp(glm::dot(p - s, d) / length, 0.0, 1.0) : 0.0;
    return glm::length(p - (s + at * d));
  };
  const double edges = std::min({to_segment(a, b), to_segment(b, c), to_segment(c, a)});
  const dvec3 n = glm::cross(b - a, c - a);
  if (glm::dot(n, n) == 0.0) return edges;
  const auto side = [&](const dvec3& s, const dvec3& e) {
    return glm::dot(glm::cross(e - s, p - s), n) >= 0.0;
  };
  if (side(a, b) && side(b, c) && side(c, a)) {
    return std::abs(glm::dot(p - a, n)) / glm::length(n);
  }
  return edges;
}

double largest(const dvec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

TEST(Triangle, HitsLieOnItAlsoEdgeOn) {
  std::mt19937_64 random(seed());
  std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
  std::uint64_t hits = 0;
  double worst = 0.0;
  for (std::uint64_t i = 0; i < scaled(3'000'000); ++i) {
    const float size = std::exp2(8.0f * unit(random));
    const auto point = [&] { return size * Vec3(unit(random), unit(random), unit(random)); };
    const Vec3 a = point(), b = point();
    // Every other triangle is a sliver.
    const Vec3 c = i % 2 ? point() : a + unit(random) * (b - a) + 1e-3f * point();
    // From beside the triangle in its plane towards a point of it, both off the plane by a little.
    const auto on_plane = [&] { return a + unit(random) * (b - a) + unit(random) * (c - a); };
    const float off = std::exp2(-13.0f + 13.0f * unit(random));
    const Vec3 origin = 2.0f * on_plane() - a + off * point();
    const float u = 0.5f + 0.5f * unit(random), v = (1.0f - u) * (0.5f + 0.5f * unit(random));
    const Vec3 target = a + u * (b - a) + v * (c - a);
    const kernels::Ray ray{origin, 0.0f, target - origin, 1e30f};
    kernels::TriangleHit hit;
    if (!kernels::intersect_triangle(kernels::make_slab_ray(ray),
                                     kernels::make_triangle_ray(ray.direction), a, b, c, 0.0f,
                                     1e30f, false, &hit)) {
      continue;
    }
    ++hits;
    const dvec3 p = dvec3(origin) + double{hit.t} * dvec3(ray.direction);
    const dvec3 o(origin);
    const double reach =
        std::max({largest(dvec3(a) - o), largest(dvec3(b) - o), largest(dvec3(c) - o)});
    const double side = std::max({largest(b - a), largest(c - b), largest(a - c)});
    const double allowed = side / 2048.0 + reach * 0x1p-20;
    worst = std::max(worst, distance(p, a, b, c) / (std::sqrt(3.0) * allowed));
  }
  EXPECT_GT(hits, scaled(3'000'000) / 4);
  EXPECT_LT(worst, 1.0) << "seed " << seed();
  RecordProperty("worst", std::to_string(worst));
}

}  // namespace
}  // namespace octrace::tests
