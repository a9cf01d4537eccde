#include "tests/support/brute_force.h"

#include "kernels/triangle.h"

namespace octrace::tests {

// A second copy for machines with FMA instructions: libm's fmaf takes most of the time otherwise.
__attribute__((target_clones("default", "arch=haswell"))) kernels::Hit brute_force(
    std::span<const kernels::Vec3> positions, std::span<const kernels::Triangle> triangles,
    const kernels::Ray& ray) {
  const kernels::SlabRay slab_ray = kernels::make_slab_ray(ray);
  const kernels::TriangleRay triangle_ray = kernels::make_triangle_ray(ray.direction);
  kernels::Hit best{ray.tmax, 0.0f, 0.0f, kernels::kNone};
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const kernels::Triangle& t = triangles[i];
    kernels::TriangleHit hit;
    // In the order of indices a strictly smaller t is all that a later triangle can win by.
    if (kernels::intersect_triangle(slab_ray, triangle_ray, positions[t.a], positions[t.b],
                                    positions[t.c], ray.tmin, ray.tmax, false, &hit) &&
        (!best.valid() || hit.t < best.t)) {
      best = {hit.t, hit.u, hit.v, i};
    }
  }
  return best;
}

}  // namespace octrace::tests
