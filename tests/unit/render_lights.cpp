// Punctual lights on a plane, against closed forms and the reference BRDF.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/unit/reference_brdf.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using render::Aov;

constexpr int kSize = 24;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

kernels::Light point_light(Vec3 position, float candela) {
  kernels::Light light{};
  light.type = kernels::LightType::point;
  light.position = position;
  light.direction = Vec3(0, 0, -1);
  light.intensity = Vec3(candela);
  light.range = kInfinity;
  return light;
}

render::Settings without_sky(std::uint32_t spp = 1) {
  render::Settings settings;
  settings.params.sky = Vec3(0.0f);
  settings.params.spp = spp;
  return settings;
}

// A plane at z = 0 seen from +z by an orthographic camera that spans [-1, 1].
Rendered render_plane(scene::Scene& scene, const ReferenceBrdf& brdf, std::uint32_t spp = 1) {
  kernels::Material material = matte(Vec3(static_cast<float>(brdf.base)));
  material.metallic = static_cast<float>(brdf.metallic);
  material.roughness = static_cast<float>(brdf.roughness);
  add_mesh(scene, make_quad({0, 0, 0}, 4), add_material(scene, material));
  return render_scene(scene, orthographic_at({0, 0, 5}, 1), kSize, kSize, without_sky(spp));
}

dvec3 place(int x, int y) { return {2 * (x + 0.5) / kSize - 1, 1 - 2 * (y + 0.5) / kSize, 0}; }

double lit_by_point(const ReferenceBrdf& brdf, const dvec3& p, const dvec3& light, double candela) {
  const dvec3 l = light - p;
  return brdf.evaluate({0, 0, 1}, glm::normalize(l)) * candela / glm::dot(l, l);
}

TEST(Lights, PointFallsOffWithTheSquareOfDistance) {
  for (const ReferenceBrdf& brdf : {ReferenceBrdf{0.5, 0, 1}, ReferenceBrdf{0.9, 1, 0.3}}) {
    for (const float height : {0.25f, 1.0f, 30.0f}) {
      scene::Scene scene = empty_scene();
      scene.lights.push_back(point_light({0.2f, -0.1f, height}, 7));
      const Rendered image = render_plane(scene, brdf);
      for (int y = 0; y < kSize; ++y) {
        for (int x = 0; x < kSize; ++x) {
          const double expected = lit_by_point(brdf, place(x, y), {0.2, -0.1, height}, 7);
          ASSERT_NEAR(image.rgba(x, y).x, expected, 2e-4 * expected + 1e-9);
          ASSERT_EQ(image.rgba(x, y).w, 1.0f);
        }
      }
      EXPECT_EQ(image.stats.shadow_rays, static_cast<std::uint64_t>(kSize * kSize));
    }
  }
}

TEST(Lights, RangeEndsSmoothly) {
  const ReferenceBrdf brdf{0.5, 0, 1};
  scene::Scene scene = empty_scene();
  scene.lights.push_back(point_light({0, 0, 0.5f}, 3));
  scene.lights[0].range = 1.0f;
  const Rendered image = render_plane(scene, brdf);
  int dark = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double d = glm::length(place(x, y) - dvec3(0, 0, 0.5));
      const double window = std::max(0.0, 1 - std::pow(d, 4));
      dark += window == 0;
      const double expected = lit_by_point(brdf, place(x, y), {0, 0, 0.5}, 3) * window;
      ASSERT_NEAR(image.rgba(x, y).y, expected, 5e-5);
    }
  }
  EXPECT_GT(dark, 50);
}

TEST(Lights, SpotCone) {
  const double inner = 0.2, outer = 0.5;
  const ReferenceBrdf brdf{0.8, 0, 1};
  scene::Scene scene = empty_scene();
  kernels::Light light = point_light({0, 0, 1.5f}, 10);
  light.type = kernels::LightType::spot;
  const double scale = 1 / (std::cos(inner) - std::cos(outer));
  light.spot_scale = static_cast<float>(scale);
  light.spot_offset = static_cast<float>(-std::cos(outer) * scale);
  scene.lights.push_back(light);
  const Rendered image = render_plane(scene, brdf);
  int full = 0, partial = 0, none = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double radius = glm::length(place(x, y)), angle = std::atan2(radius, 1.5);
      const double linear =
          (std::cos(angle) - std::cos(outer)) / (std::cos(inner) - std::cos(outer));
      const double cone = std::pow(std::min(std::max(linear, 0.0), 1.0), 2);
      ++(cone == 0 ? none : cone == 1 ? full : partial);
      const double expected = lit_by_point(brdf, place(x, y), {0, 0, 1.5}, 10) * cone;
      ASSERT_NEAR(image.rgba(x, y).x, expected, 2e-5) << angle;
    }
  }
  EXPECT_GT(full, 20);
  EXPECT_GT(partial, 50);
  EXPECT_GT(none, 50);
}

TEST(Lights, DirectionalAndBehind) {
  const ReferenceBrdf brdf{0.6, 0, 0.7};
  scene::Scene scene = empty_scene();
  kernels::Light light{};
  light.type = kernels::LightType::directional;
  light.direction = Vec3(0.6f, 0, -0.8f);
  light.intensity = Vec3(2, 4, 0);
  light.range = kInfinity;
  scene.lights.push_back(light);
  light.direction = Vec3(0, 0, 1);  // from below the surface
  scene.lights.push_back(light);
  const Rendered image = render_plane(scene, brdf);
  const double expected = brdf.evaluate({0, 0, 1}, {-0.6, 0, 0.8});
  EXPECT_NEAR(image.rgba(3, 5).x, 2 * expected, 1e-5);
  EXPECT_NEAR(image.rgba(3, 5).y, 4 * expected, 1e-5);
  EXPECT_EQ(image.rgba(3, 5).z, 0.0f);
  EXPECT_EQ(image.stats.shadow_rays, static_cast<std::uint64_t>(kSize * kSize));
}

TEST(Lights, SceneWithoutLightsGetsASun) {
  scene::Scene scene = empty_scene();
  const Rendered image = render_plane(scene, {0.5, 0, 1});
  EXPECT_GT(image.rgba(4, 4).x, 0.05f);
  EXPECT_GT(image.rgba(4, 4).x, image.rgba(4, 4).z);  // warm
}

// A square of half size 0.25 between a light at height 2 and the plane throws a shadow twice its
// size.
Rendered with_blocker(kernels::Material material, bool turned_away,
                      const render::Settings& settings) {
  scene::Scene scene = empty_scene();
  scene.lights.push_back(point_light({0, 0, 2}, 5));
  add_mesh(scene, make_quad({0, 0, 0}, 4), add_material(scene, matte(Vec3(0.5f))));
  MeshData blocker = make_quad({0, 0, 1}, 0.25f);
  if (turned_away)
    for (kernels::Triangle& t : blocker.triangles) std::swap(t.b, t.c);
  add_mesh(scene, blocker, add_material(scene, material));
  return render_scene(scene, orthographic_at({0, 0, 5}, 1), kSize, kSize, settings);
}

TEST(Lights, ShadowsHaveTheRightShape) {
  const ReferenceBrdf brdf{0.5, 0, 1};
  kernels::Material glass = matte(Vec3(0.5f));
  glass.alpha_mode = kernels::AlphaMode::blend;
  glass.base_color.w = 0.25f;
  for (const bool blend : {false, true}) {
    for (const bool turned_away : {false, true}) {
      const Rendered image =
          with_blocker(blend ? glass : matte(Vec3(0.5f)), turned_away, without_sky());
      int shadowed = 0, lit = 0;
      for (int y = 0; y < kSize; ++y) {
        for (int x = 0; x < kSize; ++x) {
          const dvec3 p = place(x, y);
          const double reach = std::max(std::abs(p.x), std::abs(p.y));
          if (reach < 0.26) continue;  // the blocker itself
          // On its diagonal a ray meets both triangles, and glass dims twice.
          if (std::abs(p.x - p.y) < 1e-3) continue;
          const double expected = lit_by_point(brdf, p, {0, 0, 2}, 5);
          const double share = reach > 0.5 ? 1.0 : blend ? 0.75 : 0.0;
          ++(reach > 0.5 ? lit : shadowed);
          ASSERT_NEAR(image.rgba(x, y).x, expected * share, 1e-4 * expected);
        }
      }
      EXPECT_GT(shadowed, 50);
      EXPECT_GT(lit, 200);
    }
  }
}

TEST(Lights, ManyLightsAreSampledWithoutBias) {
  const ReferenceBrdf brdf{0.5, 0, 1};
  scene::Scene scene = empty_scene();
  for (int i = 0; i < 50; ++i)
    scene.lights.push_back(point_light({std::sin(i * 1.7f), std::cos(i * 2.3f), 1.0f + 0.02f * i},
                                       0.1f * (1 + i % 5)));
  const std::uint32_t spp = 64;
  const Rendered image = render_plane(scene, brdf, spp);
  // Followed: 16 of 50 a sample.
  EXPECT_EQ(image.stats.shadow_rays, static_cast<std::uint64_t>(kSize * kSize) * spp * 16);
  double sum = 0, expected = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      double here = 0;
      for (const kernels::Light& light : scene.lights)
        here += lit_by_point(brdf, place(x, y), dvec3(light.position), light.intensity.x);
      expected += here;
      sum += image.rgba(x, y).x;
      ASSERT_NEAR(image.rgba(x, y).x, here, 0.05 * here);
    }
  }
  EXPECT_NEAR(sum, expected, 0.002 * expected);
}

TEST(Lights, OneOnTheSurfaceStaysFinite) {
  scene::Scene scene = empty_scene();
  const dvec3 p = place(5, 5);
  scene.lights.push_back(point_light(Vec3(p), 1e30f));
  scene.lights.push_back(point_light({0, 0, 1e-30f}, 3e38f));
  scene.lights.push_back(point_light({3e38f, 0, 3e38f}, 3e38f));
  const Rendered image = render_plane(scene, {1, 1, 0}, 4);
  for (const float value : image.framebuffer.floats(Aov::beauty)) ASSERT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace octrace::test
