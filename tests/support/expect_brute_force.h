// Hits of octrees beside those of brute force.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <random>
#include <span>

#include "kernels/cpu/intersect.h"
#include "tests/support/brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {

// So many random rays hit the same triangle in every octree, at the same bits of t, as by brute
// force.
inline void expect_brute_force(const Mesh& mesh, std::span<const octree::Octree> octrees,
                               std::uint64_t rays) {
  const kernels::CpuTracer tracer;
  std::mt19937_64 random(seed());
  for (std::uint64_t i = 0; i < rays; ++i) {
    const kernels::Ray ray = random_ray(mesh, octrees[i % octrees.size()], random);
    const kernels::Hit expected = brute_force(mesh.positions, mesh.triangles, ray);
    for (const octree::Octree& octree : octrees) {
      kernels::SceneView view;
      view.octree = octree.view();
      kernels::Hit found;
      ASSERT_EQ(kernels::TraceStatus::ok, tracer.closest(view, {}, ray, &found));
      ASSERT_EQ(found.triangle, expected.triangle)
          << mesh.name << ", seed " << seed() << ", ray " << i;
      if (expected.valid()) {
        ASSERT_EQ(0, std::memcmp(&found.t, &expected.t, sizeof(float)));
      }
    }
  }
}

}  // namespace octrace::tests
