#include "tests/bench/views.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "tests/bench/ray_sets.h"

namespace octrace::bench {

namespace {

struct Point {
  glm::dvec3 place, normal;
};

class Surface {
 public:
  explicit Surface(const scene::Scene& scene) : scene_(scene) {
    double area = 0.0;
    for (const kernels::Triangle& t : scene.triangles) {
      area += glm::length(cross(t));
      areas_.push_back(area);
    }
  }

  double area() const { return areas_.empty() ? 0.0 : areas_.back(); }

  Point random_point(std::mt19937_64& random) const {
    const double at = uniform(random) * areas_.back();
    const auto found = std::upper_bound(areas_.begin(), areas_.end() - 1, at);
    const kernels::Triangle& t = scene_.triangles[static_cast<std::size_t>(found - areas_.begin())];
    double u = uniform(random), v = uniform(random);
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const glm::dvec3 a(scene_.positions[t.a]), b(scene_.positions[t.b]), c(scene_.positions[t.c]);
    return {a + u * (b - a) + v * (c - a), glm::normalize(cross(t))};
  }

 private:
  static double uniform(std::mt19937_64& random) {
    return static_cast<double>(random() >> 11) * 0x1p-53;
  }
  glm::dvec3 cross(const kernels::Triangle& t) const {
    const glm::dvec3 a(scene_.positions[t.a]);
    return glm::cross(glm::dvec3(scene_.positions[t.b]) - a, glm::dvec3(scene_.positions[t.c]) - a);
  }

  const scene::Scene& scene_;
  std::vector<double> areas_;  // sums
};

}  // namespace

std::vector<scene::Camera> scattered_views(const scene::Scene& scene, const octree::Octree& octree,
                                           const octree::WideOctree& wide, std::uint32_t count) {
  const Surface surface(scene);
  if (!(surface.area() > 0.0)) return {};
  const double diagonal =
      glm::length(glm::dvec3(scene.bounds.upper) - glm::dvec3(scene.bounds.lower));
  std::mt19937_64 random(1);
  std::vector<Point> from(count), to(count);
  std::vector<kernels::Ray> rays(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    from[i] = surface.random_point(random);
    to[i] = surface.random_point(random);
    rays[i].origin = kernels::Vec3(from[i].place + 1e-4 * diagonal * from[i].normal);
    rays[i].direction = kernels::Vec3(from[i].normal);
    rays[i].tmin = 0.0f;
    rays[i].tmax = static_cast<float>(0.2 * diagonal);
  }
  std::vector<kernels::Hit> hits;
  trace_cpu(scene, octree, wide, rays, false, false, 1, &hits);
  std::vector<scene::Camera> views;
  for (std::uint32_t i = 0; i < count; ++i) {
    const double free = hits[i].valid() ? double{hits[i].t} : double{rays[i].tmax};
    views.push_back(scene::look_at(from[i].place + 0.5 * free * from[i].normal, to[i].place, 1.0));
  }
  return views;
}

}  // namespace octrace::bench
