#include "tests/bench/ray_sets.h"

#include <glm/geometric.hpp>

#include <cmath>

namespace octrace::bench {

using kernels::Hit;
using kernels::Ray;
using kernels::Vec3;

namespace {

// PCG hash (Jarzynski and Olano 2020, "Hash functions for GPU rendering").
std::uint32_t hash(std::uint32_t x) {
  x = x * 747796405u + 2891336453u;
  x = ((x >> ((x >> 28) + 4u)) ^ x) * 277803737u;
  return (x >> 22) ^ x;
}

float uniform(std::uint32_t index, std::uint32_t dimension) {
  return static_cast<float>(hash(index * 4u + dimension) >> 8) * 0x1p-24f;
}

// Duff et al. 2017, "Building an orthonormal basis, revisited".
Vec3 cosine_direction(const Vec3& n, float u1, float u2) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  const Vec3 tangent(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x);
  const Vec3 bitangent(b, sign + n.y * n.y * a, -n.y);
  const float radius = std::sqrt(u1), angle = 6.2831853f * u2;
  return glm::normalize(radius * std::cos(angle) * tangent + radius * std::sin(angle) * bitangent +
                        std::sqrt(1.0f - u1) * n);
}

}  // namespace

std::vector<Ray> primary_rays(const kernels::RayCamera& camera, int width, int height) {
  std::vector<Ray> rays;
  rays.reserve(static_cast<std::size_t>(width) * height);
  constexpr int kTile = 4;
  for (int ty = 0; ty < height; ty += kTile) {
    for (int tx = 0; tx < width; tx += kTile) {
      for (int y = ty; y < std::min(ty + kTile, height); ++y) {
        for (int x = tx; x < std::min(tx + kTile, width); ++x) {
          Ray ray = camera_ray(camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
          ray.direction = glm::normalize(ray.direction);
          ray.tmin = 0.0f;
          ray.tmax = kNoLimit;
          rays.push_back(ray);
        }
      }
    }
  }
  return rays;
}

Rays secondary_rays(RaySet set, const scene::Scene& scene, const std::vector<Ray>& primary,
                    const std::vector<Hit>& hits) {
  const bool ao = set == RaySet::ao;
  Rays result{set, ao, {}};
  const float diagonal = glm::length(scene.bounds.upper - scene.bounds.lower);
  for (std::uint32_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].valid()) continue;
    const kernels::Triangle& t = scene.triangles[hits[i].triangle];
    const Vec3 a = scene.positions[t.a], b = scene.positions[t.b], c = scene.positions[t.c];
    Vec3 normal = glm::normalize(glm::cross(b - a, c - a));
    if (glm::dot(normal, primary[i].direction) > 0.0f) normal = -normal;
    const Vec3 point = primary[i].origin + hits[i].t * primary[i].direction;
    const std::uint32_t dimension = ao ? 2 : 0;
    const Vec3 direction =
        cosine_direction(normal, uniform(i, dimension), uniform(i, dimension + 1));
    result.rays.push_back(
        {point + 1e-4f * diagonal * normal, 0.0f, direction, ao ? 0.1f * diagonal : kNoLimit});
  }
  return result;
}

const char* name_of(RaySet set) {
  switch (set) {
    case RaySet::primary:
      return "primary";
    case RaySet::bounce:
      return "bounce";
    case RaySet::ao:
      return "ao";
  }
  return "";
}

}  // namespace octrace::bench
