// Shading as a whole: furnaces, emission, occlusion, and the artefacts that rays and normals make.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/reference_brdf.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using render::Aov;

constexpr int kSize = 32;

kernels::Material material_of(const ReferenceBrdf& brdf) {
  kernels::Material material = matte(Vec3(static_cast<float>(brdf.base)));
  material.metallic = static_cast<float>(brdf.metallic);
  material.roughness = static_cast<float>(brdf.roughness);
  return material;
}

render::Settings white_sky(std::uint32_t spp) {
  render::Settings settings;
  settings.params.sky = Vec3(1.0f);
  settings.params.spp = spp;
  return settings;
}

// The mean over the ball of radiance against the directional albedo at each pixel's angle.
void expect_furnace(const ReferenceBrdf& brdf, Vec3 centre, float radius, double tolerance) {
  scene::Scene scene = empty_scene();
  add_darkness(scene);
  add_mesh(scene, make_ball(centre, radius, 128, 64, true), add_material(scene, material_of(brdf)));
  const Rendered image =
      render_scene(scene, orthographic_at(centre + Vec3(0, 0, 3 * radius), radius * 1.2), kSize,
                   kSize, white_sky(36), "beauty,N,mask");
  std::array<double, 65> albedo;  // by cosine
  for (int i = 0; i <= 64; ++i)
    albedo[static_cast<std::size_t>(i)] = brdf.white_sky((i + 0.01) / 64.02);
  double sum = 0, expected = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double px = 1.2 * (2 * (x + 0.5) / kSize - 1), py = 1.2 * (2 * (y + 0.5) / kSize - 1);
      const double r = std::sqrt(px * px + py * py);
      if (r > 0.9) continue;  // the edge's pixels mix angles
      const double place = std::sqrt(1 - r * r) * 64, low = std::floor(place);
      const auto entry = static_cast<std::size_t>(low);
      const double want = albedo[entry] + (place - low) * (albedo[entry + 1] - albedo[entry]);
      sum += image.rgba(x, y).x;
      expected += want;
      ASSERT_NEAR(image.rgba(x, y).x, want, 0.08 * want) << "at radius " << r;
    }
  }
  EXPECT_NEAR(sum, expected, tolerance * expected)
      << "roughness " << brdf.roughness << " metallic " << brdf.metallic;
}

TEST(Furnace, ConvexBodyShowsItsDirectionalAlbedo) {
  expect_furnace({1.0, 0, 1.0}, {0, 0, 0}, 1, 0.003);
  expect_furnace({0.5, 0, 0.3}, {0, 0, 0}, 1, 0.003);
  expect_furnace({0.9, 1, 0.5}, {0, 0, 0}, 1, 0.003);
  expect_furnace({1.0, 1, 0.05}, {0, 0, 0}, 1, 0.003);
}

// Rays that start at a surface must not meet it again, at any size and any distance from the
// origin: each one that did would darken its pixel.
TEST(Furnace, HoldsFarFromTheOriginAndAtAnySize) {
  expect_furnace({0.8, 0, 0.6}, {1e5f, -1e5f, 1e5f}, 100, 0.004);
  expect_furnace({0.8, 0, 0.6}, {0, 0, 0}, 1e-4f, 0.004);
  expect_furnace({0.8, 0, 0.6}, {0, 0, 0}, 1e6f, 0.004);
  expect_furnace({0.8, 0, 0.6}, {7000, 0, 0}, 1, 0.004);
}

// A mirror in a closed white box sees white; without reflections it would see black.
TEST(Beauty, MetalsReflectSurfaces) {
  scene::Scene scene = empty_scene();
  add_darkness(scene);
  kernels::Material mirror = matte(Vec3(1.0f), 0.0f);
  mirror.metallic = 1.0f;
  MeshData floor = make_quad({0, 0, 0}, 50);
  add_mesh(scene, floor, add_material(scene, mirror));
  kernels::Material ceiling;
  ceiling.unlit = 1;
  ceiling.double_sided = 1;
  ceiling.base_color = Vec4(0.25f, 0.5f, 0.75f, 1.0f);
  MeshData roof = make_quad({0, 0, 9}, 500);
  add_mesh(scene, roof, add_material(scene, ceiling));
  render::Settings settings;
  settings.params.sky = Vec3(0.0f);
  const Rendered image = render_scene(scene, orthographic_at({0, 0, 8}, 1), 8, 8, settings);
  EXPECT_NEAR(image.rgba(4, 4).x, 0.25, 0.004);
  EXPECT_NEAR(image.rgba(4, 4).z, 0.75, 0.008);
}

// Half of the sky's cosine-weighted light is hidden by a wall at a right angle far along.
TEST(Beauty, SkyIsShadowedByGeometry) {
  scene::Scene scene = empty_scene();
  add_darkness(scene);
  add_mesh(scene, make_quad({0, 0, 0}, 1000), add_material(scene, matte(Vec3(0.6f))));
  MeshData wall;
  wall.positions = {{0.5f, -1000, 0}, {0.5f, 1000, 0}, {0.5f, 1000, 1000}, {0.5f, -1000, 1000}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  kernels::Material black = matte(Vec3(0.0f));
  black.double_sided = 1;
  add_mesh(scene, wall, add_material(scene, black));
  const ReferenceBrdf brdf{0.6, 0, 1};
  // Straight down, at x = 0: the wall hides the half space beyond it.
  render::Settings settings = white_sky(1024);
  const Rendered image = render_scene(scene, orthographic_at({0, 0, 5}, 0.01), 4, 4, settings);
  double mean = 0;
  for (int i = 0; i < 16; ++i) mean += image.rgba(i % 4, i / 4).x / 16;
  const double open = brdf.white_sky(1.0);
  EXPECT_NEAR(mean, open / 2, 0.02 * open);
}

TEST(Beauty, EmissionAndOcclusionTexture) {
  scene::Scene scene = empty_scene();
  kernels::Material material = matte(Vec3(0.5f));
  material.emissive = Vec3(3, 2, 1);
  material.emissive_texture.texture = add_texture(scene, 1, 1, {0xff00ff80u}, kernels::Wrap::repeat,
                                                  kernels::Filter::linear, false);
  material.occlusion_texture.texture = add_texture(
      scene, 1, 1, {0xff00ff33u}, kernels::Wrap::repeat, kernels::Filter::linear, false);
  material.occlusion_strength = 0.5f;
  add_mesh(scene, make_quad({0, 0, 0}, 9), add_material(scene, material));
  kernels::Light sun{};
  sun.type = kernels::LightType::directional;
  sun.direction = Vec3(0, 0, -1);
  sun.intensity = Vec3(1.0f);
  sun.range = std::numeric_limits<float>::infinity();
  scene.lights.push_back(sun);
  const Rendered image =
      render_scene(scene, orthographic_at({0, 0, 5}, 1), 8, 8, white_sky(256), "beauty");
  const ReferenceBrdf brdf{0.5, 0, 1};
  const double lit = brdf.evaluate({0, 0, 1}, {0, 0, 1});
  const double sky = brdf.white_sky(1.0) * (1 + 0.5 * (0.2 - 1));
  EXPECT_NEAR(image.rgba(4, 4).x, 3 * (128 / 255.0) + lit + sky, 0.004);
  EXPECT_NEAR(image.rgba(4, 4).y, 2 + lit + sky, 0.004);
  EXPECT_NEAR(image.rgba(4, 4).z, 0 + lit + sky, 0.004);
}

TEST(Beauty, MetallicRoughnessTextureChannels) {
  scene::Scene scene = empty_scene();
  add_darkness(scene);
  kernels::Material material;
  material.base_color = Vec4(0.8f, 0.8f, 0.8f, 1);
  material.metallic = 0.5f;
  material.roughness = 0.8f;
  // Green 0.4 is roughness, blue 1 is metallic; red must not matter.
  material.metallic_roughness_texture.texture = add_texture(
      scene, 1, 1, {0xffff6611u}, kernels::Wrap::repeat, kernels::Filter::linear, false);
  add_mesh(scene, make_quad({0, 0, 0}, 9), add_material(scene, material));
  const Rendered image =
      render_scene(scene, orthographic_at({0, 0, 5}, 1), 4, 4, white_sky(1024), "beauty");
  const double expected = ReferenceBrdf{0.8, 0.5, 0.32}.white_sky(1.0);
  EXPECT_NEAR(image.rgba(1, 1).x, expected, 0.002);
  EXPECT_GT(std::abs(expected - ReferenceBrdf({0.8, 0.5, 0.8}).white_sky(1.0)), 0.02);
}

// A coarse ball with smooth normals must not show its facets where light grazes them.
TEST(Beauty, CoarseSmoothMeshHasNoBlackTerminator) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0, 0, 0}, 1, 16, 8, true), add_material(scene, matte(Vec3(0.8f))));
  kernels::Light sun{};
  sun.type = kernels::LightType::directional;
  sun.direction = Vec3(glm::normalize(dvec3(-1, -0.2, -0.3)));
  sun.intensity = Vec3(1.0f);
  sun.range = std::numeric_limits<float>::infinity();
  scene.lights.push_back(sun);
  render::Settings settings;
  settings.params.sky = Vec3(0.0f);
  settings.params.spp = 1;
  const Rendered image = render_scene(scene, orthographic_at({0, 0, 5}, 1.1), 96, 96, settings);
  const ReferenceBrdf brdf{0.8, 0, 1};
  int grazing = 0;
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 96; ++x) {
      if (image.value(Aov::mask, x, y) == 0.0f) continue;
      const dvec3 n(image.vec3(Aov::normal, x, y)), l = -dvec3(sun.direction), v(0, 0, 1);
      const double cosine = glm::dot(n, l);
      if (cosine < 0.03 || n.z < 0.2) continue;
      grazing += cosine < 0.3;
      // In the normal's frame, which is all that the reference knows.
      const dvec3 side = glm::normalize(glm::cross(n, dvec3(0.3, 0.9, 0.1)));
      const dvec3 up = glm::cross(n, side);
      const auto local = [&](const dvec3& w) {
        return dvec3(glm::dot(w, side), glm::dot(w, up), glm::dot(w, n));
      };
      const double expected = brdf.evaluate(local(v), local(l));
      ASSERT_NEAR(image.rgba(x, y).x, expected, 0.02 * expected + 1e-4)
          << x << "," << y << " cosine " << cosine;
    }
  }
  EXPECT_GT(grazing, 300);
}

TEST(Beauty, BrokenNormalsTangentsAndFactorsStayFinite) {
  std::mt19937 random(23);
  scene::Scene scene = empty_scene();
  std::uniform_real_distribution<float> uniform(-1, 1);
  kernels::Material material;
  material.roughness = 0.0f;
  material.double_sided = 1;
  material.normal_scale = 1e30f;
  material.emissive = Vec3(3e38f, 0, 1);
  material.normal_texture.texture =
      add_texture(scene, 2, 2, {0xff000000u, 0xffffffffu, 0xff808080u, 0xffff0000u},
                  kernels::Wrap::repeat, kernels::Filter::linear, false);
  const auto index = add_material(scene, material);
  for (int i = 0; i < 60; ++i) {
    MeshData mesh;
    for (int k = 0; k < 3; ++k) {
      mesh.positions.push_back({uniform(random), uniform(random), uniform(random)});
      mesh.normals.push_back(i % 3 == 0   ? Vec3(0.0f)
                             : i % 3 == 1 ? Vec3(1e-30f, 0, 0)
                                          : Vec3(uniform(random), uniform(random), -1));
      mesh.uvs.push_back(i % 2 ? Vec2(0.5f) : Vec2(1e30f * uniform(random), uniform(random)));
    }
    mesh.triangles = {{0, 1, 2}};
    const auto geometry = add_mesh(scene, mesh, index);
    if (i % 5 == 0) {
      scene.geometries[geometry].tangents = static_cast<std::uint32_t>(scene.tangents.size());
      scene.tangents.resize(scene.tangents.size() + 3, Vec4(0.0f));
    }
  }
  const Rendered image = render_scene(scene, camera_at({0, 0, 2}, 1.0), 48, 48, white_sky(4));
  for (const render::AovInfo& info : render::aov_table()) {
    if (info.aov == Aov::depth || info.aov == Aov::distance) continue;
    for (const float value : image.framebuffer.floats(info.aov))
      ASSERT_TRUE(std::isfinite(value)) << info.option;
  }
}

}  // namespace
}  // namespace octrace::test
