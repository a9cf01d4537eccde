#include "exporters/blender/blender.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "backend/image/image.h"
#include "exporters/gltf/gltf.h"
#include "tests/unit/exporters_programs.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {
namespace {

// Blender works in single precision from the camera's position on.
constexpr double kDepthError = 1e-5;
constexpr int kWidth = 160, kHeight = 120;

std::vector<Sight> read_sights(const std::string& path) {
  const auto image = image::read(path, {});
  if (!image) {
    ADD_FAILURE() << image.error().to_string();
    return {};
  }
  const auto* alpha = image->find("ViewLayer.Combined.A");
  const auto* depth = image->find("ViewLayer.Depth.Z");
  const auto* object = image->find("ViewLayer.IndexOB.X");
  if (alpha == nullptr || depth == nullptr || object == nullptr) {
    ADD_FAILURE() << path << " lacks a channel";
    return {};
  }
  std::vector<Sight> sights(alpha->floats.size());
  for (std::size_t i = 0; i < sights.size(); ++i) {
    sights[i] = {depth->floats[i], static_cast<std::uint32_t>(object->floats[i])};
    EXPECT_TRUE(alpha->floats[i] == 0.0f || alpha->floats[i] == 1.0f);
    EXPECT_EQ(alpha->floats[i] == 1.0f, sights[i].object != 0) << "pixel " << i;
    if (sights[i].object == 0) {
      EXPECT_EQ(depth->floats[i], static_cast<float>(exporters::kBlenderBackgroundDepth));
    }
  }
  return sights;
}

exporters::BlenderView view_of(const scene::Scene& scene, const scene::Camera& camera,
                               const std::string& output) {
  exporters::BlenderView view;
  view.camera = camera;
  view.width = kWidth;
  view.height = kHeight;
  view.output = output;
  exporters::blender_clip(scene.bounds, view);
  return view;
}

TEST(Blender, ShowsWhatARayCasterShows) {
  if (!installed("blender")) GTEST_SKIP() << "blender is not installed";
  const TemporaryFolder folder;
  scene::Scene scene = varied_scene();
  // Blender draws one of two coincident sheets as it pleases, and lacks nothing else of the scene.
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    if (scene.geometries[5].first_vertex <= i &&
        i < scene.geometries[5].first_vertex + scene.geometries[5].vertex_count) {
      scene.positions[i].z -= 0.01f;
    }
  }
  // Where the two wrap modes differ, Blender's importer makes a seam that does not blend across.
  scene.textures[0].wrap_s = kernels::Wrap::mirror;
  ASSERT_TRUE(exporters::write_gltf(scene, folder.file("scene.glb")));

  scene::Camera front = look_at({0.3, 0.4, 9.5}, {0, 0, 0}, 0.75);
  scene::Camera clipped = front;
  clipped.znear = 9.0;
  clipped.zfar = 11.5;
  scene::Camera flat = look_at({3, 2.5, 8}, {0, 0, 0}, 0.5);
  flat.type = scene::CameraType::orthographic;
  flat.ymag = 3.1;
  scene::Camera pinhole = look_at({0.5, 0.4, 9.0}, {0, 0, 0}, 0.5);
  pinhole.type = scene::CameraType::pinhole;
  pinhole.fx = 145;
  pinhole.fy = 130;
  pinhole.cx = 71.5;
  pinhole.cy = 64.25;
  const scene::Camera cameras[] = {front, clipped, flat, pinhole};

  exporters::BlenderScene spec, plain;
  spec.file = plain.file = "scene.glb";
  // '#' stands for the frame in Blender's own paths.
  for (int i = 0; i < 4; ++i) {
    spec.views.push_back(view_of(scene, cameras[i], "view #" + std::to_string(i) + ".exr"));
  }
  plain.cull = plain.alpha = false;
  plain.views = {view_of(scene, cameras[0], "plain.exr")};
  exporters::BlenderScene missing;
  missing.file = "nowhere.glb";
  missing.views = {view_of(scene, front, "never.exr")};
  std::ofstream(folder.file("never.exr")) << "of an earlier run";

  ASSERT_TRUE(exporters::write_blender({spec, missing, plain}, folder.file("job.py")));
  const int code = run_in(folder.path(), "blender", exporters::blender_arguments("job.py"));
  const std::string log = read_text(folder.file("blender.log"));
  EXPECT_EQ(code, 3) << log;  // one scene is missing, and the others are rendered all the same
  EXPECT_NE(log.find("octrace: failed nowhere.glb"), std::string::npos) << log;
  EXPECT_FALSE(std::filesystem::exists(folder.file("never.exr")));

  const CastOptions options{kWidth, kHeight, true, true};
  for (int i = 0; i < 4; ++i) {
    SCOPED_TRACE(spec.views[static_cast<std::size_t>(i)].output);
    expect_same_sight(cast_rays(scene, cameras[i], options),
                      read_sights(folder.file(spec.views[static_cast<std::size_t>(i)].output)),
                      kWidth, 5, kDepthError);
  }
  expect_same_sight(cast_rays(scene, front, {kWidth, kHeight, false, false}),
                    read_sights(folder.file("plain.exr")), kWidth, 5, kDepthError);
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    EXPECT_NE(entry.path().filename().string().substr(0, 9), ".octrace-") << entry.path();
  }
}

}  // namespace
}  // namespace octrace::test
