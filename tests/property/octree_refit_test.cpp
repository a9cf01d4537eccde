// An octree refitted to moved triangles: every invariant of a built one, and brute force's hits.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "backend/octree/update.h"
#include "kernels/cpu/intersect.h"
#include "tests/support/brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Hit;
using octree::Builder;
using octree::Octree;

Octree build(const Mesh& mesh, Builder builder) {
  octree::BuildOptions options;
  options.builder = builder;
  options.cuts = false;  // as for scenes that are refitted: a refit makes parts whole
  util::Result<Octree> octree = octree::build(mesh.input(), options);
  EXPECT_TRUE(octree);
  return std::move(*octree);
}

enum class Motion { none, shift, twist, scatter, collapse };

// About the mesh's own centre and in its own size, so that small and far meshes move alike.
Mesh moved(const Mesh& mesh, Motion motion, std::mt19937_64& random) {
  Mesh result = mesh;
  kernels::Vec3 lower = mesh.positions[0], upper = lower;
  for (const auto& p : mesh.positions) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  const kernels::Vec3 centre = 0.5f * (lower + upper), size = upper - lower;
  const float largest = std::max({size.x, size.y, size.z, 1e-6f});
  std::uniform_real_distribution<float> uniform(-0.5f, 0.5f);
  for (auto& p : result.positions) {
    const kernels::Vec3 q = p - centre;
    switch (motion) {
      case Motion::none:
        break;
      case Motion::shift:
        p += kernels::Vec3(3.0f, -0.25f, 0.125f) * largest;
        break;
      case Motion::twist: {
        const float angle = 2.0f * q.y / largest;
        p = centre + kernels::Vec3(q.x * std::cos(angle) - q.z * std::sin(angle), q.y,
                                   q.x * std::sin(angle) + q.z * std::cos(angle));
        break;
      }
      case Motion::scatter:
        p = centre + largest * kernels::Vec3(uniform(random), uniform(random), uniform(random));
        break;
      case Motion::collapse:
        p = centre;
        break;
    }
  }
  return result;
}

void expect_brute_force(const Mesh& mesh, const Octree& octree, std::mt19937_64& random,
                        std::uint64_t rays) {
  kernels::SceneView view;
  view.octree = octree.view();
  const kernels::CpuTracer tracer;
  for (std::uint64_t i = 0; i < rays; ++i) {
    const kernels::Ray ray = random_ray(mesh, octree, random);
    const Hit expected = brute_force(mesh.positions, mesh.triangles, ray);
    Hit found;
    ASSERT_EQ(kernels::TraceStatus::ok, tracer.closest(view, {}, ray, &found));
    ASSERT_EQ(expected.triangle, found.triangle) << mesh.name << ", ray " << i;
    if (!expected.valid()) continue;
    ASSERT_EQ(std::bit_cast<std::uint32_t>(expected.t), std::bit_cast<std::uint32_t>(found.t));
    ASSERT_EQ(std::bit_cast<std::uint32_t>(expected.u), std::bit_cast<std::uint32_t>(found.u));
  }
}

struct OctreeRefit : testing::TestWithParam<std::size_t> {
  Mesh mesh = hard_meshes()[GetParam()];
};

TEST_P(OctreeRefit, ChangesNothingWhereNothingMoved) {
  for (const Builder builder : {Builder::median, Builder::sah}) {
    const Octree before = build(mesh, builder);
    Octree after = before;
    const double cost = octree::refit(mesh.input(), after);
    EXPECT_NEAR(cost, octree::statistics(before).sah_cost, 1e-6 * cost);
    EXPECT_EQ(0, std::memcmp(before.nodes.data(), after.nodes.data(),
                             before.nodes.size() * sizeof(kernels::Node)));
    EXPECT_EQ(0, std::memcmp(before.triangles.data(), after.triangles.data(),
                             before.triangles.size() * sizeof(kernels::LeafTriangle)));
  }
}

TEST_P(OctreeRefit, IsSoundAndHitsWhatBruteForceHits) {
  std::mt19937_64 random(seed() + GetParam());
  SCOPED_TRACE(seed());
  for (const Builder builder : {Builder::median, Builder::sah}) {
    Octree octree = build(mesh, builder);
    for (const Motion motion :
         {Motion::shift, Motion::twist, Motion::scatter, Motion::collapse, Motion::none}) {
      const Mesh after = moved(mesh, motion, random);
      octree::refit(after.input(), octree);
      const util::Result<void> sound = octree::verify(octree, after.input());
      ASSERT_TRUE(sound) << mesh.name << ": " << sound.error().to_string();
      expect_brute_force(after, octree, random, scaled(1000));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, OctreeRefit, testing::Range<std::size_t>(0, hard_meshes().size()));

scene::Scene scene_of(const Mesh& mesh) {
  scene::Scene scene;
  scene.positions = mesh.positions;
  scene.triangles = mesh.triangles;
  scene.triangle_geometry.assign(mesh.triangles.size(), 0);
  scene.geometries.resize(1);
  scene.materials.resize(1);
  return scene;
}

TEST(OctreeUpdate, RefitsWhatBendsAndRebuildsWhatIsScattered) {
  std::mt19937_64 random(seed());
  const Mesh mesh = make_grid(64, 0.3f, 2.0f);
  const scene::Scene rest = scene_of(mesh), shifted = scene_of(moved(mesh, Motion::shift, random)),
                     scattered = scene_of(moved(mesh, Motion::scatter, random));
  util::Result<Octree> octree = octree::build(rest, {});
  ASSERT_TRUE(octree);
  octree::Upkeep upkeep;
  ASSERT_TRUE(octree::update(shifted, {}, {}, *octree, upkeep));
  EXPECT_FALSE(upkeep.rebuilt);
  EXPECT_NEAR(upkeep.cost, upkeep.built_cost, 0.05 * upkeep.built_cost);
  ASSERT_TRUE(octree::update(scattered, {}, {}, *octree, upkeep));
  EXPECT_TRUE(upkeep.rebuilt);
  EXPECT_TRUE(octree::verify(*octree, scattered));
  ASSERT_TRUE(octree::update(scattered, {}, {}, *octree, upkeep));
  EXPECT_FALSE(upkeep.rebuilt);
  ASSERT_TRUE(octree::update(rest, {}, {}, *octree, upkeep));
  EXPECT_TRUE(octree::verify(*octree, rest));
}

}  // namespace
}  // namespace octrace::tests
