// The motion plane against closed forms: own projection, own rotation, double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using glm::dvec2;
using glm::dvec3;
using render::Aov;

constexpr int kWidth = 64, kHeight = 48;
constexpr double kYfov = 0.8;

scene::Scene wall(float half = 8) {
  scene::Scene scene = empty_scene();
  MeshData quad = make_quad({0, 0, 0}, half);
  for (Vec3& p : quad.positions) p.z = 0.3f * p.x - 0.2f * p.y - 1.0f;
  add_mesh(scene, quad, add_material(scene, matte({1, 1, 1})));
  return scene;
}

// Pixels of a point in the camera's own space, from the definition in docs/conventions.md.
dvec2 perspective_pixel(const dvec3& p) {
  const double half = std::tan(kYfov / 2);
  return {(p.x / -p.z / (half * kWidth / kHeight) + 1) * kWidth / 2,
          (1 - p.y / -p.z / half) * kHeight / 2};
}
dvec2 orthographic_pixel(const dvec3& p, double ymag) {
  return {(p.x / (ymag * kWidth / kHeight) + 1) * kWidth / 2, (1 - p.y / ymag) * kHeight / 2};
}

Rendered render_motion(const scene::Scene& scene, const scene::Camera& now,
                       const scene::Camera& next, const std::vector<Vec3>& positions,
                       std::string_view aovs = "motion,P,mask") {
  render::Settings settings;
  settings.next = {positions, scene::make_ray_camera(next, kWidth, kHeight)};
  return render_scene(scene, now, kWidth, kHeight, settings, aovs);
}

dvec2 motion(const Rendered& image, int x, int y) {
  const auto plane = image.framebuffer.floats(Aov::motion);
  const auto at = 2 * static_cast<std::size_t>(y * kWidth + x);
  return {plane[at], plane[at + 1]};
}

// `moved`: where a point of the surface is in the next frame; `pixel`: of a world point, then.
void expect_motion(const Rendered& image, const std::function<dvec3(dvec3)>& moved,
                   const std::function<dvec2(dvec3)>& pixel, double tolerance) {
  int hits = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (image.value(Aov::mask, x, y) == 0.0f) {
        ASSERT_EQ(motion(image, x, y), dvec2(0.0));
        continue;
      }
      ++hits;
      const dvec3 here(image.vec3(Aov::position, x, y));
      const dvec2 expected = pixel(moved(here)) - dvec2(x + 0.5, y + 0.5);
      ASSERT_LE(glm::length(motion(image, x, y) - expected), tolerance)
          << x << ", " << y << ": " << expected.x << " " << expected.y;
    }
  }
  EXPECT_GT(hits, 500);
}

std::vector<Vec3> shifted(const scene::Scene& scene, Vec3 by) {
  std::vector<Vec3> positions = scene.positions;
  for (Vec3& p : positions) p += by;
  return positions;
}

TEST(Motion, IsTowardsTheRightAndDown) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_quad({0, 0, 0}, 1), add_material(scene, matte({1, 1, 1})));
  const scene::Camera camera = camera_at({0, 0, 4}, kYfov);
  const Rendered right = render_motion(scene, camera, camera, shifted(scene, {0.5f, 0, 0}));
  EXPECT_GT(motion(right, 32, 24).x, 1.0);
  EXPECT_NEAR(motion(right, 32, 24).y, 0.0, 1e-4);
  const Rendered down = render_motion(scene, camera, camera, shifted(scene, {0, -0.5f, 0}));
  EXPECT_GT(motion(down, 32, 24).y, 1.0);
  EXPECT_NEAR(motion(down, 32, 24).x, 0.0, 1e-4);
}

TEST(Motion, OfAMovingWallInPerspective) {
  const scene::Scene scene = wall(1.5f);
  const dvec3 eye(0.5, 0.25, 4), by(0.375, -0.25, 0.5);
  const scene::Camera camera = camera_at(Vec3(eye), kYfov);
  const Rendered image = render_motion(scene, camera, camera, shifted(scene, Vec3(by)));
  expect_motion(
      image, [&](dvec3 p) { return p + by; }, [&](dvec3 p) { return perspective_pixel(p - eye); },
      1e-4);
}

TEST(Motion, OfATurningWall) {
  const scene::Scene scene = wall(1.5f);
  const glm::dmat4 turn = glm::rotate(glm::dmat4(1.0), 0.3, glm::normalize(dvec3(1, 2, 3)));
  const auto moved = [&](dvec3 p) { return dvec3(turn * glm::dvec4(p, 1.0)); };
  std::vector<Vec3> positions;
  for (const Vec3& p : scene.positions) positions.push_back(Vec3(moved(dvec3(p))));
  const dvec3 eye(0, 0, 4);
  const scene::Camera camera = camera_at(Vec3(eye), kYfov);
  expect_motion(
      render_motion(scene, camera, camera, positions), moved,
      [&](dvec3 p) { return perspective_pixel(p - eye); }, 1e-4);
}

TEST(Motion, OfAMovingCamera) {
  const scene::Scene scene = wall();
  const scene::Camera now = camera_at({0.5f, 0.25f, 4}, kYfov);
  scene::Camera next = now;
  next.matrix = glm::translate(glm::dmat4(1.0), dvec3(0.7, 0.1, 3.5)) *
                glm::rotate(glm::dmat4(1.0), 0.2, glm::normalize(dvec3(0.3, 1, -0.2)));
  const glm::dmat4 to_camera = glm::inverse(next.matrix);
  const auto pixel = [&](dvec3 p) {
    return perspective_pixel(dvec3(to_camera * glm::dvec4(p, 1)));
  };
  expect_motion(
      render_motion(scene, now, next, {}), [](dvec3 p) { return p; }, pixel, 2e-4);
  const dvec3 by(0, 0.5, -0.25);
  expect_motion(
      render_motion(scene, now, next, shifted(scene, Vec3(by))), [&](dvec3 p) { return p + by; },
      pixel, 2e-4);
}

TEST(Motion, WithParallelRays) {
  const scene::Scene scene = wall(1.5f);
  const dvec3 eye(0.25, 0.5, 4), by(0.125, 0.25, 2.0);
  const scene::Camera camera = orthographic_at(Vec3(eye), 2.0);
  expect_motion(
      render_motion(scene, camera, camera, shifted(scene, Vec3(by))),
      [&](dvec3 p) { return p + by; }, [&](dvec3 p) { return orthographic_pixel(p - eye, 2.0); },
      1e-4);
}

TEST(Motion, OfAPinholeCamera) {
  const scene::Scene scene = wall();
  scene::Camera now = camera_at({0, 0, 4}, kYfov);
  now.type = scene::CameraType::pinhole;
  now.fx = 70, now.fy = 50, now.cx = 20, now.cy = 30;
  scene::Camera next = now;
  next.matrix[3].x = 0.5;
  expect_motion(
      render_motion(scene, now, next, {}), [](dvec3 p) { return p; },
      [](dvec3 p) {
        p -= dvec3(0.5, 0, 4);
        return dvec2(20 + 70 * p.x / -p.z, 30 - 50 * p.y / -p.z);
      },
      1e-4);
}

// Not small: nothing, so that users can tell what moved.
TEST(Motion, OfWhatStandsStillIsExactlyZero) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0.3f, 0.2f, -100.7f}, 30.1f, 40, 20, true),
           add_material(scene, matte({1, 1, 1})));
  for (const scene::Camera& camera :
       {camera_at({0.1f, 0.2f, 0.3f}, kYfov), orthographic_at({0.1f, 0.2f, 0.3f}, 50.0)}) {
    for (const auto& positions : {scene.positions, std::vector<Vec3>()}) {
      const Rendered image = render_motion(scene, camera, camera, positions);
      for (const float value : image.framebuffer.floats(Aov::motion)) ASSERT_EQ(value, 0.0f);
    }
  }
}

TEST(Motion, IsZeroWhereThereIsNoNextFrameOrThePointGoesBehindTheCamera) {
  const scene::Scene scene = wall();
  const scene::Camera camera = camera_at({0, 0, 4}, kYfov);
  const Rendered still = render_scene(scene, camera, kWidth, kHeight, {}, "motion");
  for (const float value : still.framebuffer.floats(Aov::motion)) ASSERT_EQ(value, 0.0f);
  const Rendered behind = render_motion(scene, camera, camera, shifted(scene, {1, 0, 20}));
  for (const float value : behind.framebuffer.floats(Aov::motion)) ASSERT_EQ(value, 0.0f);
}

TEST(Motion, ChangesNoOtherPlane) {
  const scene::Scene scene = wall(1.5f);
  const scene::Camera camera = camera_at({0.5f, 0.25f, 4}, kYfov);
  const Rendered with = render_motion(scene, camera, camera, shifted(scene, {1, 1, 0}), "all");
  std::string others;
  for (const render::AovInfo& info : render::aov_table()) {
    if (info.aov == Aov::motion) continue;
    others.append(others.empty() ? "" : ",").append(info.option);
  }
  const Rendered without = render_scene(scene, camera, kWidth, kHeight, {}, others);
  for (const render::AovInfo& info : render::aov_table()) {
    if (info.aov == Aov::motion) continue;
    const auto a = info.uint32 ? std::as_bytes(with.framebuffer.uints(info.aov))
                               : std::as_bytes(with.framebuffer.floats(info.aov));
    const auto b = info.uint32 ? std::as_bytes(without.framebuffer.uints(info.aov))
                               : std::as_bytes(without.framebuffer.floats(info.aov));
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(0, std::memcmp(a.data(), b.data(), a.size())) << info.option;
  }
}

}  // namespace
}  // namespace octrace::test
