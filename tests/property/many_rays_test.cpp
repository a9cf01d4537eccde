// Many rays at once against the walk of the octree's own nodes, one ray at a time: a scene that is
// large enough for rays to be given up as groups and taken up again, with surfaces that are culled,
// cut out and let light through.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>

#include "backend/octree/wide.h"
#include "kernels/cpu/intersect.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Hit;
using kernels::Ray;
using kernels::Vec3;

float uniform(std::mt19937_64& random, float from, float to) {
  return std::uniform_real_distribution<float>(from, to)(random);
}
Vec3 in_cube(std::mt19937_64& random, float half) {
  return {uniform(random, -half, half), uniform(random, -half, half), uniform(random, -half, half)};
}

enum Kind : std::uint32_t { kSolid, kCulled, kHoles, kGlass, kKinds };

// Small triangles in a cube, of four materials in turns. Every hole is whole: a triangle of kHoles
// is there or not by its own geometry's alpha.
struct SoupScene {
  Mesh mesh{"soup", {}, {}};
  std::vector<std::uint32_t> triangle_geometry;
  std::vector<kernels::Geometry> geometries;
  std::vector<kernels::Material> materials;
  std::vector<std::uint32_t> flags;
  octree::Octree octree;

  explicit SoupScene(std::uint32_t count) {
    std::mt19937_64 random(seed());
    for (std::uint32_t i = 0; i < count; ++i) {
      const Vec3 a = in_cube(random, 1.0f);
      mesh.positions.insert(mesh.positions.end(),
                            {a, a + in_cube(random, 0.05f), a + in_cube(random, 0.05f)});
      mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
      triangle_geometry.push_back(i % (2 * kKinds));
    }
    constexpr std::uint32_t kFlags[kKinds] = {0, kernels::kCullBack, kernels::kAlphaTest,
                                              kernels::kBlend};
    for (std::uint32_t i = 0; i < 2 * kKinds; ++i) {
      const std::uint32_t kind = i % kKinds;
      kernels::Geometry geometry{};
      geometry.material = i;
      geometry.normals = geometry.tangents = geometry.uv0 = geometry.uv1 = geometry.colors =
          kernels::kNone;
      geometries.push_back(geometry);
      kernels::Material material;
      material.base_color.w = kind == kHoles ? (i < kKinds ? 0.25f : 0.75f) : 0.6f;
      materials.push_back(material);
      flags.push_back(kFlags[kind]);
    }
    octree::BuildOptions options;
    options.builder = octree::Builder::quality;
    octree = std::move(*octree::build(
        octree::BuildInput{mesh.positions, mesh.triangles, triangle_geometry, flags}, options));
  }

  kernels::SceneView view() const {
    kernels::SceneView view;
    view.octree = octree.view();
    view.triangles = {mesh.triangles.data(), mesh.triangles.size()};
    view.triangle_geometry = {triangle_geometry.data(), triangle_geometry.size()};
    view.geometries = {geometries.data(), geometries.size()};
    view.materials = {materials.data(), materials.size()};
    return view;
  }
};

// Blocks of rays anywhere, of fans (64 from nearly one point), and of fans from the mesh's surface
// that reach a tenth of it; of each block every other ray has zeros, axes and corners in it.
std::vector<Ray> make_rays(const SoupScene& scene, std::size_t count) {
  std::mt19937_64 random(seed() + 1);
  std::vector<Ray> rays;
  Vec3 centre{0.0f};
  for (std::size_t i = 0; i < count; ++i) {
    Ray ray = random_ray(scene.mesh, scene.octree, random);
    const std::size_t block = i / 5000 % 3;
    if (i % 64 == 0) centre = ray.origin;
    if (block != 0) {
      const Vec3 target = ray.origin + ray.direction;
      ray.origin = centre + in_cube(random, 0.01f);
      if (i % 2 == 0) ray.direction = target - ray.origin;
      if (block == 2) ray.tmax = 0.2f / std::max(length(ray.direction), 1e-3f);
    }
    if (i % 1000 == 999) ray.direction = Vec3(std::numeric_limits<float>::quiet_NaN());
    if (i % 3000 == 2998) ray.origin *= 1e6f;  // whose group it would lead through all of the scene
    rays.push_back(ray);
  }
  return rays;
}

std::string describe(const Ray& ray, const Hit& expected, const Hit& found) {
  char text[400];
  std::snprintf(text, sizeof text, "o=(%a %a %a) d=(%a %a %a) t=[%a %a]: %u t=%a, found %u t=%a",
                ray.origin.x, ray.origin.y, ray.origin.z, ray.direction.x, ray.direction.y,
                ray.direction.z, ray.tmin, ray.tmax, expected.triangle, expected.t, found.triangle,
                found.t);
  return text;
}

bool same_bits(const Hit& a, const Hit& b) {
  return a.triangle == b.triangle && (!a.valid() || std::memcmp(&a, &b, sizeof a) == 0);
}

void check(const SoupScene& scene, const std::vector<Ray>& rays) {
  const octree::WideOctree wide = octree::make_wide(scene.octree.view());
  ASSERT_FALSE(wide.view().empty());
  const kernels::SceneView view = scene.view();
  const kernels::CpuTracer tracer(wide.view());
  const auto count = static_cast<std::uint32_t>(rays.size());
  for (const std::uint32_t cull : {0u, 1u}) {
    kernels::RenderParams params;
    params.cull = cull;
    params.alpha = 1;
    std::vector<Hit> many(count), coherent(count);
    std::vector<float> clear(count, -1.0f);
    using kernels::TraceStatus;
    ASSERT_EQ(TraceStatus::ok, tracer.closest(view, params, rays.data(), count, many.data()));
    ASSERT_EQ(TraceStatus::ok,
              tracer.closest_coherent(view, params, rays.data(), count, coherent.data()));
    ASSERT_EQ(TraceStatus::ok,
              tracer.transmittance(view, params, rays.data(), count, clear.data()));
    std::uint64_t kinds[kKinds] = {}, dimmed = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      if (std::isnan(rays[i].direction.x)) continue;  // its neighbours have to be right
      Hit expected;
      float transmittance = -1.0f;
      ASSERT_EQ(TraceStatus::ok,
                closest_hit(view, params, rays[i], kernels::ScalarChildTest{}, &expected));
      ASSERT_EQ(TraceStatus::ok, shadow_transmittance(view, params, rays[i],
                                                      kernels::ScalarChildTest{}, &transmittance));
      ASSERT_TRUE(same_bits(expected, many[i]))
          << i << ": " << describe(rays[i], expected, many[i]);
      ASSERT_TRUE(same_bits(expected, coherent[i]))
          << i << ", packets: " << describe(rays[i], expected, coherent[i]);
      ASSERT_EQ(transmittance, clear[i]) << i << ": " << describe(rays[i], expected, many[i]);
      if (expected.valid()) ++kinds[scene.triangle_geometry[expected.triangle] % kKinds];
      dimmed += transmittance > 0.0f && transmittance < 1.0f;
    }
    for (const std::uint64_t hits : kinds) EXPECT_GT(hits, count / 100);
    EXPECT_GT(dimmed, count / 100);
  }
}

TEST(ManyRays, HitWhatOneRayHits) {
  const SoupScene scene(30'000);
  const std::vector<Ray> rays = make_rays(scene, scaled(30'000));
  for (const std::int64_t target : {std::int64_t{HWY_AVX3}, std::int64_t{HWY_AVX2}}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    check(scene, rays);
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace octrace::tests
