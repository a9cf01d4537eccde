#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "backend/scene/camera.h"
#include "backend/scene/scene.h"

namespace octrace::scene {
namespace {

using glm::dmat4;
using glm::dvec3;
using glm::dvec4;

dvec3 at(const kernels::Ray& ray, double t) { return dvec3(ray.origin) + t * dvec3(ray.direction); }

// Where a world point appears, by a projection matrix in the manner of OpenGL: another way than
// rays.
glm::dvec2 project(const dmat4& projection, const dmat4& rigid, const dvec3& point, double width,
                   double height) {
  const dvec4 clip = projection * glm::inverse(rigid) * dvec4(point, 1.0);
  return {(clip.x / clip.w * 0.5 + 0.5) * width, (0.5 - clip.y / clip.w * 0.5) * height};
}

dmat4 random_rigid(std::mt19937& random, double reach) {
  std::normal_distribution<double> normal;
  const glm::dquat q =
      glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random)));
  dmat4 rigid = glm::mat4_cast(q);
  rigid[3] = dvec4(reach * normal(random), reach * normal(random), reach * normal(random), 1.0);
  return rigid;
}

TEST(SceneCamera, PerspectiveRaysProjectBackToTheirPixels) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit;
  for (int i = 0; i < 200; ++i) {
    const dmat4 rigid = random_rigid(random, 3.0);
    Camera camera;
    camera.yfov = 0.05 + 2.5 * unit(random);
    const dvec3 scale(0.1 + unit(random), 0.1 + 4 * unit(random), 0.1 + unit(random));
    camera.matrix = rigid * glm::scale(dmat4(1.0), scale);
    const int width = 1 + random() % 4000, height = 1 + random() % 4000;
    const auto rays = make_ray_camera(camera, width, height);
    const dmat4 projection = glm::perspective(camera.yfov, double(width) / height, 0.1, 100.0);
    for (int k = 0; k < 20; ++k) {
      const double x = width * unit(random), y = height * unit(random), t = 0.5 + 9 * unit(random);
      const dvec3 point = at(camera_ray(rays, float(x), float(y)), t);
      const dvec3 local = dvec3(glm::inverse(rigid) * dvec4(point, 1.0));
      const double reach = t * glm::length(dvec3(camera_ray(rays, float(x), float(y)).direction));
      EXPECT_NEAR(-local.z, t, 4e-7 * (reach + 10.0)) << "t is the planar depth";
      const auto pixel = project(projection, rigid, point, width, height);
      const double tolerance = 1e-5 * std::max(width, height) / std::tan(camera.yfov / 2) + 1e-3;
      EXPECT_NEAR(pixel.x, x, tolerance);
      EXPECT_NEAR(pixel.y, y, tolerance);
    }
    EXPECT_NEAR(glm::length(rays.axis), 1.0, 1e-6);
  }
}

TEST(SceneCamera, OrthographicRaysProjectBackAndIgnoreXmag) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit;
  for (int i = 0; i < 100; ++i) {
    const dmat4 rigid = random_rigid(random, 3.0);
    Camera camera;
    camera.type = CameraType::orthographic;
    camera.xmag = i % 3 == 0 ? -2.0 : 1000.0 * unit(random);
    camera.ymag = (0.1 + 5 * unit(random)) * (i % 5 == 0 ? -1.0 : 1.0);
    camera.matrix = rigid;
    const int width = 640, height = 1 + random() % 1000;
    const double xmag = std::abs(camera.ymag) * width / height * (i % 3 == 0 ? -1.0 : 1.0);
    const dmat4 projection = glm::ortho(-xmag, xmag, -camera.ymag, camera.ymag, 0.0, 100.0);
    const auto rays = make_ray_camera(camera, width, height);
    for (int k = 0; k < 20; ++k) {
      const double x = width * unit(random), y = height * unit(random), t = 9 * unit(random);
      const dvec3 point = at(camera_ray(rays, float(x), float(y)), t);
      EXPECT_NEAR(-(glm::inverse(rigid) * dvec4(point, 1.0)).z, t, 2e-5);
      const auto pixel = project(projection, rigid, point, width, height);
      EXPECT_NEAR(pixel.x, x, 2e-5 * height / std::abs(camera.ymag) + 2e-3);
      EXPECT_NEAR(pixel.y, y, 2e-5 * height / std::abs(camera.ymag) + 2e-3);
    }
  }
}

TEST(SceneCamera, PinholeScalesWithTheImageWhereItsSizeIsGiven) {
  Camera camera;
  camera.type = CameraType::pinhole;
  camera.fx = 600.0, camera.fy = 580.0, camera.cx = 310.0, camera.cy = 250.0;
  camera.width = 640, camera.height = 480;
  // Computer vision's own formula, with y and z down and forwards there.
  const auto expect = [&](int width, int height) {
    const auto rays = make_ray_camera(camera, width, height);
    for (const double x : {0.5, 100.0, 640.0}) {
      for (const double y : {0.5, 333.0, 480.0}) {
        const double sx = width / 640.0, sy = height / 480.0;
        const dvec3 point = at(camera_ray(rays, float(x * sx), float(y * sy)), 4.0);
        EXPECT_NEAR(point.x, (x - camera.cx) / camera.fx * 4.0, 1e-5);
        EXPECT_NEAR(point.y, -(y - camera.cy) / camera.fy * 4.0, 1e-5);
        EXPECT_NEAR(point.z, -4.0, 1e-6);
      }
    }
  };
  expect(640, 480);
  expect(1280, 960);
  expect(320, 960);
  camera.width = camera.height = 0;
  const auto rays = make_ray_camera(camera, 99, 55);
  EXPECT_NEAR(at(camera_ray(rays, 310.0f, 250.0f), 1.0).x, 0.0, 1e-6);
}

TEST(SceneCamera, RowZeroIsTheTop) {
  Camera camera;
  const auto rays = make_ray_camera(camera, 10, 10);
  EXPECT_GT(camera_ray(rays, 5.0f, 0.5f).direction.y, 0.0f);
  EXPECT_LT(camera_ray(rays, 0.5f, 5.0f).direction.x, 0.0f);
  EXPECT_EQ(rays.axis, kernels::Vec3(0.0f, 0.0f, -1.0f));
}

TEST(SceneCamera, MirroredMatrixMirrorsTheImageAndKeepsTheAxis) {
  Camera camera;
  camera.matrix[0] = dvec4(-2, 0, 0, 0);
  const auto rays = make_ray_camera(camera, 10, 10);
  EXPECT_GT(camera_ray(rays, 0.5f, 5.0f).direction.x, 0.0f);
  EXPECT_EQ(rays.axis, kernels::Vec3(0.0f, 0.0f, -1.0f));
}

TEST(SceneCamera, DegenerateMatricesStillGiveAnOrthonormalView) {
  const dvec4 zero(0.0), x(1, 0, 0, 0), y(0, 3, 0, 0), z(0, 0, 1, 0), p(1, 2, 3, 1);
  for (const dmat4& matrix :
       {dmat4(zero, zero, zero, p), dmat4(x, y, zero, p), dmat4(zero, zero, z, p),
        dmat4(x, zero, z, p), dmat4(zero, y, z, p), dmat4(z, z, z, p), dmat4(x, x, z, p),
        dmat4(x * 1e-200, y * 1e200, z * 1e-300, p), dmat4(zero, zero, y, p)}) {
    Camera camera;
    camera.matrix = matrix;
    const auto rays = make_ray_camera(camera, 8, 8);
    const dvec3 right(rays.direction_x), down(rays.direction_y), axis(rays.axis);
    EXPECT_NEAR(glm::length(axis), 1.0, 1e-6);
    EXPECT_NEAR(glm::length(right), glm::length(down), 1e-6);
    EXPECT_GT(glm::length(right), 0.0);
    EXPECT_NEAR(glm::dot(right, down), 0.0, 1e-6);
    EXPECT_NEAR(glm::dot(right, axis), 0.0, 1e-6);
    EXPECT_NEAR(glm::dot(down, axis), 0.0, 1e-6);
  }
}

Bounds box(const kernels::Vec3& lower, const kernels::Vec3& upper) { return {lower, upper, false}; }

TEST(SceneCamera, FramedBoundsLieWithinTheImageAndInFrontOfZnear) {
  for (const Bounds& bounds :
       {box({-1, -1, -1}, {1, 1, 1}), box({0, 0, 0}, {100, 1, 1}), box({5, 5, 5}, {5, 5, 5}),
        box({-3, 0, 2}, {3, 0, 9}), box({1e8f, 1e8f, 1e8f}, {1.1e8f, 1.2e8f, 1.1e8f}),
        box({1e-6f, 0, 0}, {2e-6f, 1e-6f, 1e-6f}), box({0, 0, 0}, {0, 0, 0}), Bounds{}}) {
    for (const double aspect : {0.2, 1.0, 16.0 / 9.0, 10.0}) {
      const Camera camera = frame_bounds(bounds, aspect);
      const dmat4 projection = glm::perspective(camera.yfov, aspect, 1.0, 2.0);
      ASSERT_GT(camera.znear, 0.0);
      double extreme = 0.0;
      for (int corner = 0; corner < 8; ++corner) {
        const dvec3 p(corner & 1 ? bounds.upper.x : bounds.lower.x,
                      corner & 2 ? bounds.upper.y : bounds.lower.y,
                      corner & 4 ? bounds.upper.z : bounds.lower.z);
        const dvec3 local = dvec3(glm::inverse(camera.matrix) * dvec4(p, 1.0));
        EXPECT_LT(local.z, -camera.znear);
        const auto pixel = project(projection, camera.matrix, p, 1.0, 1.0);
        extreme = std::max({extreme, std::abs(pixel.x - 0.5), std::abs(pixel.y - 0.5)});
      }
      EXPECT_LE(extreme, 0.5);
      // And fills a good part of it, unless there is nothing to see.
      if (bounds.upper.x > bounds.lower.x) {
        EXPECT_GE(extreme, 0.3);
      }
    }
  }
}

class CameraFile : public ::testing::Test {
 protected:
  util::Result<Camera> read(const std::string& text) {
    // Cases run at the same time, each in a process of its own.
    const std::string path =
        ::testing::TempDir() + "octrace_camera_" + std::to_string(::getpid()) + ".json";
    std::ofstream(path) << text;
    util::Result<Camera> camera = read_camera_file(path);
    std::remove(path.c_str());
    return camera;
  }
};

const char* const kMatrix = R"("matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 7,8,9,1])";

TEST_F(CameraFile, ReadsEveryKind) {
  auto camera =
      read(std::string(R"({"type": "perspective", "yfov": 0.7, "znear": 0.5, "zfar": 9, )") +
           kMatrix + "}");
  ASSERT_TRUE(camera) << camera.error().to_string();
  EXPECT_EQ(camera->type, CameraType::perspective);
  EXPECT_EQ(camera->yfov, 0.7);
  EXPECT_EQ(camera->znear, 0.5);
  EXPECT_EQ(camera->zfar, 9.0);
  EXPECT_EQ(camera->matrix[3], dvec4(7, 8, 9, 1));

  camera = read(std::string(R"({"type": "orthographic", "xmag": 2, "ymag": 3, )") + kMatrix + "}");
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->type, CameraType::orthographic);
  EXPECT_EQ(camera->ymag, 3.0);
  EXPECT_EQ(camera->znear, 0.0);
  EXPECT_TRUE(std::isinf(camera->zfar));

  for (const char* type : {"", R"("type": "pinhole", )", R"("type": "perspective", )"}) {
    camera = read(std::string("{") + type + R"("fx": 500, "fy": 510, "cx": 320, "cy": -1, )" +
                  R"("width": 640, "height": 480, )" + kMatrix + "}");
    ASSERT_TRUE(camera) << camera.error().to_string();
    EXPECT_EQ(camera->type, CameraType::pinhole);
    EXPECT_EQ(camera->fy, 510.0);
    EXPECT_EQ(camera->height, 480.0);
  }
}

TEST_F(CameraFile, RefusesWhatIsWrongByPointer) {
  const std::string matrix = kMatrix;
  const struct {
    std::string text;
    const char* pointer;
  } cases[] = {
      {"", ""},
      {"[]", ""},
      {"{", ""},
      {"{}", ""},
      {R"({"type": "perspective", "yfov": 1e999, )" + matrix + "}", ""},
      {R"({"type": "fisheye", )" + matrix + "}", "/type"},
      {R"({"type": 3, )" + matrix + "}", "/type"},
      {R"({"type": "perspective", )" + matrix + "}", ""},
      {R"({"type": "perspective", "yfov": "0.7", )" + matrix + "}", "/yfov"},
      {R"({"type": "perspective", "yfov": 0, )" + matrix + "}", "/yfov"},
      {R"({"type": "perspective", "yfov": 3.2, )" + matrix + "}", "/yfov"},
      {R"({"type": "perspective", "yfov": 0.7, "xmag": 1, )" + matrix + "}", "/xmag"},
      {R"({"type": "perspective", "yfov": 0.7, "a/b~": 1, )" + matrix + "}", "/a~1b~0"},
      {R"({"type": "perspective", "yfov": 0.7, "fx": 5, )" + matrix + "}", "/yfov"},
      {R"({"type": "perspective", "yfov": 0.7, "znear": -1, )" + matrix + "}", "/znear"},
      {R"({"type": "perspective", "yfov": 0.7, "znear": 2, "zfar": 2, )" + matrix + "}", "/zfar"},
      {R"({"type": "perspective", "yfov": 0.7, "name": 1, )" + matrix + "}", "/name"},
      {R"({"type": "perspective", "yfov": 0.7})", ""},
      {R"({"type": "perspective", "yfov": 0.7, "matrix": 1})", "/matrix"},
      {R"({"type": "perspective", "yfov": 0.7, "matrix": [1,2]})", "/matrix"},
      {R"({"type": "perspective", "yfov": 0.7,
           "matrix": [1,0,0,0, 0,1,0,0, 0,0,"1",0, 7,8,9,1]})",
       "/matrix/10"},
      {R"({"type": "perspective", "yfov": 0.7,
           "matrix": [1,0,0,7, 0,1,0,8, 0,0,1,9, 0,0,0,1]})",
       "/matrix/3"},
      {R"({"type": "perspective", "yfov": 0.7,
           "matrix": [1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]})",
       "/matrix/4"},
      {R"({"type": "perspective", "yfov": 0.7,
           "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 1e31,0,0,1]})",
       "/matrix/12"},
      {R"({"type": "orthographic", "xmag": 1, )" + matrix + "}", ""},
      {R"({"type": "orthographic", "xmag": 1, "ymag": -1, )" + matrix + "}", "/ymag"},
      {R"({"fx": 500, "fy": 500, "cx": 320, )" + matrix + "}", ""},
      {R"({"fx": 500, "fy": -5, "cx": 320, "cy": 1, )" + matrix + "}", "/fy"},
      {R"({"fx": 500, "fy": 5, "cx": 320, "cy": 1, "width": 5, )" + matrix + "}", ""},
  };
  for (const auto& [text, pointer] : cases) {
    const auto camera = read(text);
    ASSERT_FALSE(camera) << text;
    EXPECT_EQ(camera.error().exit, util::Exit::invalid_input) << text;
    EXPECT_EQ(camera.error().pointer, pointer) << text << "\n" << camera.error().to_string();
  }
}

TEST_F(CameraFile, MissingAndEndlessFilesAreErrors) {
  EXPECT_EQ(read_camera_file("/nonexistent/camera.json").error().exit, util::Exit::io);
  EXPECT_EQ(read_camera_file("/dev/zero").error().exit, util::Exit::limit);
  EXPECT_EQ(read_camera_file("/").error().exit, util::Exit::io);
}

}  // namespace
}  // namespace octrace::scene
