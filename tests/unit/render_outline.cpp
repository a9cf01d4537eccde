// Blocks of an image that are said to see nothing, against every ray in them.
#include "backend/render/outline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "backend/octree/instance_levels.h"
#include "backend/render/motion.h"
#include "kernels/cpu/intersect.h"
#include "kernels/pixel.h"
#include "tests/support/intensity.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using glm::dvec3;

constexpr int kWidth = 64, kHeight = 48;
constexpr std::uint32_t kBlock = 8;

class Sampler {
 public:
  explicit Sampler(std::uint32_t seed) : rng_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  dvec3 direction() {
    for (;;) {
      const dvec3 v(between(-1, 1), between(-1, 1), between(-1, 1));
      if (glm::length(v) > 0.1 && glm::length(v) < 1.0) return glm::normalize(v);
    }
  }

 private:
  std::mt19937 rng_;
};

// Slivers and specks about `centre`, none larger than `size`.
scene::Scene shards(Sampler& sampler, const dvec3& centre, double size) {
  MeshData mesh;
  for (std::uint32_t i = 0; i < 40; ++i) {
    const dvec3 at = centre + sampler.direction() * size * sampler.between(0.0, 0.5);
    const double reach = size * 0.5 * std::pow(10.0, sampler.between(-3, 0));
    for (int corner = 0; corner < 3; ++corner) {
      mesh.positions.emplace_back(at + sampler.direction() * reach);
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  scene::Scene scene = empty_scene();
  add_mesh(scene, mesh, 0);
  return scene;
}

scene::Camera random_camera(Sampler& sampler, const dvec3& centre, double size) {
  const double distance = size * std::pow(10.0, sampler.between(-1.5, 2.5));
  const dvec3 eye = centre + sampler.direction() * distance;
  // Towards the scene, past it, or away from it.
  const dvec3 target = centre + sampler.direction() * distance * sampler.between(0.0, 1.5);
  scene::Camera camera;
  camera.matrix = glm::inverse(glm::lookAt(eye, target, sampler.direction()));
  if (sampler.between(0, 1) < 0.2) camera.matrix[0] = -camera.matrix[0];  // a mirrored image
  const double kind = sampler.between(0, 1);
  if (kind < 0.2) {
    camera.type = scene::CameraType::pinhole;
    camera.fx = kWidth * std::pow(10.0, sampler.between(-1, 1));
    camera.fy = camera.fx * sampler.between(0.5, 2.0);
    camera.cx = kWidth * sampler.between(-1.0, 2.0);  // beside the image as well
    camera.cy = kHeight * sampler.between(-1.0, 2.0);
  } else if (kind < 0.5) {
    camera.type = scene::CameraType::orthographic;
    camera.ymag = size * std::pow(10.0, sampler.between(-2, 1));
    camera.xmag = sampler.between(0, 1) < 0.2 ? -camera.ymag : camera.ymag;
  } else {
    camera.yfov = sampler.between(0, 1) < 0.2 ? sampler.between(2.0, 3.0)
                                              : std::pow(10.0, sampler.between(-2, 0.3));
  }
  return camera;
}

TEST(Outline, BlocksThatSeeNothingSeeNothing) {
  Sampler sampler(static_cast<std::uint32_t>(tests::seed()));
  std::uint64_t seen = 0, unseen = 0;
  const std::uint64_t rounds = tests::scaled(1500);
  for (std::uint64_t round = 0; round < rounds; ++round) {
    const double size = std::pow(10.0, sampler.between(-3, 3));
    // At the origin, or so far from it that coordinates are coarse.
    const dvec3 centre = sampler.direction() * size * std::pow(10.0, sampler.between(-2, 5));
    const scene::Scene scene = shards(sampler, centre, size);
    const auto octree = octree::build(scene, {});
    ASSERT_TRUE(octree);
    const kernels::InstancedSceneView view = octree::instanced_view(scene, *octree);
    const kernels::SceneView& world = view;
    const kernels::CpuTracer tracer;
    const kernels::RayCamera camera =
        scene::make_ray_camera(random_camera(sampler, centre, size), kWidth, kHeight);
    const render::Outline outline(world.octree, camera);
    for (std::uint32_t y0 = 0; y0 < kHeight; y0 += kBlock) {
      for (std::uint32_t x0 = 0; x0 < kWidth; x0 += kBlock) {
        if (outline.may_see({x0, y0, x0 + kBlock, y0 + kBlock})) {
          ++seen;
          continue;
        }
        ++unseen;
        for (std::uint32_t i = 0; i < kBlock * kBlock; ++i) {
          const float x = static_cast<float>(x0 + i % kBlock) + 0.5f;
          const float y = static_cast<float>(y0 + i / kBlock) + 0.5f;
          kernels::Hit hit;
          ASSERT_EQ(tracer.closest(world, {}, kernels::camera_ray(camera, x, y), &hit),
                    kernels::TraceStatus::ok);
          ASSERT_FALSE(hit.valid())
              << "seed " << tests::seed() << ", round " << round << ", pixel " << x << ", " << y;
        }
      }
    }
  }
  EXPECT_GT(seen, rounds * 3);
  EXPECT_GT(unseen, rounds * 3);
}

// Every plane, motion as well, is what a ray through each pixel gives.
TEST(Outline, BackgroundIsWhatTracingGives) {
  constexpr std::uint32_t kSide = 160;
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0.2f, 0.1f, 0}, 0.4f, 32, 16, true), 0);
  const auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  const kernels::RayCamera camera =
      scene::make_ray_camera(camera_at({0, 0, 10}, 0.4), kSide, kSide);
  std::vector<Vec3> moved = scene.positions;
  for (Vec3& position : moved) position.x += 0.1f;
  render::Settings settings;
  settings.next = {moved, camera};
  render::AovSet planes;
  planes.set().reset(static_cast<std::size_t>(render::Aov::beauty));
  render::Framebuffer image(kSide, kSide, planes), expected(kSide, kSide, planes);
  std::ranges::fill(image.words(), 0xffffffffu);
  ASSERT_TRUE(render::make_cpu_renderer(scene, *octree)->render(camera, settings, image));

  const kernels::InstancedSceneView view = octree::instanced_view(scene, *octree);
  const kernels::SceneView& world = view;
  const kernels::MotionView motion = render::make_motion_view(camera, *settings.next);
  for (std::uint32_t y = 0; y < kSide; ++y) {
    for (std::uint32_t x = 0; x < kSide; ++x) {
      ASSERT_EQ(kernels::trace_geometry(world, camera, {}, expected.view(), x, y,
                                        kernels::CpuTracer(), kernels::MotionPlane{motion}),
                kernels::TraceStatus::ok);
    }
  }
  ASSERT_EQ(image.words().size(), expected.words().size());
  EXPECT_EQ(std::memcmp(image.words().data(), expected.words().data(), image.words().size_bytes()),
            0);
}

// A ball in the middle of an image: what is well outside of it is known to be empty.
TEST(Outline, KnowsTheBackground) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0, 0, 0}, 1.0f, 32, 16, true), 0);
  const auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  for (const scene::Camera& source : {camera_at({0, 0, 10}, 0.4), orthographic_at({0, 0, 10}, 2)}) {
    const kernels::RayCamera camera = scene::make_ray_camera(source, 64, 64);
    const render::Outline outline(octree->view(), camera);
    for (std::uint32_t y = 0; y < 64; y += 8) {
      for (std::uint32_t x = 0; x < 64; x += 8) {
        const bool middle = x >= 16 && x < 48 && y >= 16 && y < 48;
        const bool border = x < 8 || x >= 56 || y < 8 || y >= 56;
        const bool may = outline.may_see({x, y, x + 8, y + 8});
        if (middle) {
          EXPECT_TRUE(may) << x << ", " << y;
        } else if (border) {
          EXPECT_FALSE(may) << x << ", " << y;
        }
      }
    }
  }
}

TEST(Outline, OfNothingIsEmpty) {
  const render::Outline outline({}, scene::make_ray_camera(camera_at({0, 0, 1}, 0.4), 8, 8));
  EXPECT_FALSE(outline.may_see({0, 0, 8, 8}));
}

// Where numbers are none, every ray is traced.
TEST(Outline, SaysNothingOfCamerasThatAreNone) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_quad({0, 0, 0}, 1), 0);
  const auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  kernels::RayCamera camera = scene::make_ray_camera(camera_at({0, 0, 10}, 0.1), 64, 64);
  camera.origin.x = std::nanf("");
  EXPECT_TRUE(render::Outline(octree->view(), camera).may_see({0, 0, 8, 8}));
  camera = scene::make_ray_camera(camera_at({0, 0, 10}, 0.1), 64, 64);
  camera.direction_x = {};
  camera.direction_y = {};
  EXPECT_TRUE(render::Outline(octree->view(), camera).may_see({0, 0, 8, 8}));
}

}  // namespace
}  // namespace octrace::test
