// cameras.json against the images: what its numbers say of a world point must be where the tracer
// saw it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>

#include "backend/batch/camera_choice.h"
#include "backend/batch/cameras_file.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

ordered_json view_line(const scene::Camera& camera, int width, int height) {
  return {{"kind", "view"},
          {"view", 3},
          {"scene", 0},
          {"name", "ball"},
          {"camera", "c"},
          {"frame", 1},
          {"time", 0.5},
          {"size", {width, height}},
          {"files", {{{"path", "ball_c.exr"}, {"bytes", 1}}}},
          {"lens", ordered_json::parse(batch::camera_json(camera))}};
}

// As a user's script reads it: plain numbers by rows.
std::array<double, 3> apply(const json& matrix, const std::array<double, 3>& point) {
  std::array<double, 3> out{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      out[row] += matrix.at(row).at(column).get<double>() * point[column];
    }
    out[row] += matrix.at(row).at(3).get<double>();
  }
  return out;
}

double determinant(const json& m) {
  const auto at = [&](int r, int c) { return m.at(r).at(c).get<double>(); };
  return at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
         at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
         at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
}

void expect_points_on_their_pixels(const scene::Camera& camera, int width, int height) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0.2f, -0.1f, 0.3f}, 0.9f, 40, 20, false),
           add_material(scene, matte({1, 1, 1})));
  render::Settings settings;
  settings.params.cull = 0;
  const Rendered rendered = render_scene(scene, camera, width, height, settings, "Z,P,mask");
  const auto made = batch::camera_entry(view_line(camera, width, height));
  ASSERT_TRUE(made) << made.error().to_string();
  const json entry = json::parse(made->dump());

  const bool orthographic = entry.at("type") == "orthographic";
  const double fx = entry.at("fx"), fy = entry.at("fy"), cx = entry.at("cx"), cy = entry.at("cy");
  EXPECT_NEAR(determinant(entry["opencv"]["world_to_camera"]), 1.0, 1e-9);
  EXPECT_NEAR(determinant(entry["opengl"]["camera_to_world"]), 1.0, 1e-9);
  int hits = 0;
  double worst = 0.0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (rendered.value(render::Aov::mask, x, y) == 0.0f) continue;
      ++hits;
      const Vec3 p = rendered.vec3(render::Aov::position, x, y);
      const std::array<double, 3> world = {p.x, p.y, p.z};
      const auto cv = apply(entry["opencv"]["world_to_camera"], world);
      const auto gl = apply(entry["opengl"]["world_to_camera"], world);
      const double depth = rendered.value(render::Aov::depth, x, y);
      EXPECT_NEAR(cv[2], depth, 2e-6 * (1.0 + depth));
      EXPECT_NEAR(gl[0], cv[0], 1e-12);
      EXPECT_NEAR(gl[1], -cv[1], 1e-12);
      EXPECT_NEAR(gl[2], -cv[2], 1e-12);
      const double along = orthographic ? 1.0 : cv[2];
      worst = std::max({worst, std::abs(cx + fx * cv[0] / along - (x + 0.5)),
                        std::abs(cy + fy * cv[1] / along - (y + 0.5))});
      for (const char* axes : {"opengl", "opencv"}) {
        const auto back = apply(entry[axes]["camera_to_world"], axes[4] == 'g' ? gl : cv);
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(back[i], world[i], 1e-9);
      }
    }
  }
  EXPECT_GT(hits, 1000);
  EXPECT_LT(worst, 1e-3) << "pixels";
}

scene::Camera looking_at_the_ball() {
  return scene::look_at({2.0, 1.2, 3.1}, {0.2, -0.1, 0.3}, 0.6);
}

TEST(CamerasJson, PerspectivePointsLandOnTheirPixels) {
  expect_points_on_their_pixels(looking_at_the_ball(), 160, 100);
}

TEST(CamerasJson, OrthographicPointsLandOnTheirPixels) {
  scene::Camera camera = looking_at_the_ball();
  camera.type = scene::CameraType::orthographic;
  camera.xmag = 7.0;  // only its sign counts
  camera.ymag = 1.1;
  expect_points_on_their_pixels(camera, 120, 100);
}

TEST(CamerasJson, PinholePointsLandOnTheirPixelsAtAnotherSize) {
  scene::Camera camera = looking_at_the_ball();
  camera.type = scene::CameraType::pinhole;
  camera.fx = 300;
  camera.fy = 280;
  camera.cx = 150;
  camera.cy = 130;
  camera.width = 320;
  camera.height = 240;
  expect_points_on_their_pixels(camera, 200, 150);
  camera.width = camera.height = 0;
  expect_points_on_their_pixels(camera, 200, 150);
}

// A mirror shows in fx; the matrices stay rotations, as programs expect.
TEST(CamerasJson, MirroredAndScaledCamerasLandOnTheirPixels) {
  scene::Camera camera = looking_at_the_ball();
  camera.matrix = camera.matrix * glm::scale(glm::dmat4(1.0), glm::dvec3(-2.0, 3.0, 0.5));
  expect_points_on_their_pixels(camera, 100, 100);
  const auto entry = batch::camera_entry(view_line(camera, 100, 100));
  ASSERT_TRUE(entry);
  EXPECT_LT(entry->at("fx").get<double>(), 0.0);
  EXPECT_GT(entry->at("fy").get<double>(), 0.0);
  camera = looking_at_the_ball();
  camera.type = scene::CameraType::orthographic;
  camera.xmag = -1.0;
  camera.ymag = 1.1;
  expect_points_on_their_pixels(camera, 100, 100);
}

TEST(CamerasJson, AFileOfManyViewsIsJson) {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("octrace_cameras_" + std::to_string(::getpid()) + ".json"))
                               .string();
  auto file = batch::CamerasFile::create(path);
  ASSERT_TRUE(file);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(file->add(view_line(looking_at_the_ball(), 64, 48)));
  ASSERT_TRUE(file->finish());
  const json read = json::parse(std::ifstream(path));
  std::filesystem::remove(path);
  EXPECT_EQ(read["views"].size(), 3u);
  EXPECT_EQ(read["views"][1]["scene"], "ball");
  EXPECT_EQ(read["views"][1]["files"], json({"ball_c.exr"}));
  EXPECT_TRUE(read["conventions"].contains("opencv"));
}

TEST(CamerasJson, WhatIsNoViewIsAnError) {
  const ordered_json good = view_line(looking_at_the_ball(), 64, 48);
  for (const char* key : {"lens", "size", "files", "view"}) {
    ordered_json bad = good;
    bad.erase(key);
    EXPECT_FALSE(batch::camera_entry(bad)) << key;
    bad[key] = "nonsense";
    if (key != std::string("view")) {
      EXPECT_FALSE(batch::camera_entry(bad)) << key;
    }
  }
  ordered_json bad = good;
  bad["lens"]["matrix"] = {1, 2, 3};
  EXPECT_FALSE(batch::camera_entry(bad));
}

}  // namespace
}  // namespace octrace::test
