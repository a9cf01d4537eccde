#include "exporters/blender/blender.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "backend/gltf/document.h"
#include "backend/image/image.h"
#include "backend/scene/flatten.h"
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

constexpr const char* kMakeBlend = R"py(
import bpy, math, os
from mathutils import Matrix
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = 800, 400
scene.frame_start, scene.frame_end = 3, 9
for item in list(bpy.data.objects):
    bpy.data.objects.remove(item)
bpy.ops.mesh.primitive_cube_add(location=(1, 2, 3))
cube = bpy.context.object
cube.name = "moved cube"
cube.modifiers.new("split", "SUBSURF").subdivision_type = "SIMPLE"
def camera(name, kind):
    data = bpy.data.cameras.new(name)
    data.type = kind
    item = bpy.data.objects.new(name, data)
    scene.collection.objects.link(item)
    item.matrix_world = Matrix.Translation((0, -10, 1)) @ Matrix.Rotation(math.pi / 2, 4, "X")
    return data
wide = camera("wide", "PERSP")  # sensor 36 mm across the image's larger side
wide.lens = 36.0
tall = camera("tall", "PERSP")
tall.sensor_fit, tall.sensor_height, tall.lens = "VERTICAL", 20.0, 20.0
flat = camera("flat", "ORTHO")
flat.sensor_fit, flat.ortho_scale = "VERTICAL", 6.0
bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("still.blend"))
cube.keyframe_insert("location", frame=3)
cube.location.x = 5
cube.keyframe_insert("location", frame=9)
bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("moving.blend"))
)py";

void export_blend(const std::string& folder, const std::string& name) {
  const int code = run_in(folder, "blender",
                          {"-b", name + ".blend", "-noaudio", "--python-exit-code", "3", "-P",
                           OCTRACE_EXPORT_SCENE, "--", "out", "--aovs", "Z,mask"});
  ASSERT_EQ(code, 0) << read_text(folder + "/blender.log");
}

TEST(Blender, TurnsItsOwnFilesIntoScenesAndJobs) {
  if (!installed("blender")) GTEST_SKIP() << "blender is not installed";
  const TemporaryFolder folder;
  std::ofstream(folder.file("make.py")) << kMakeBlend;
  ASSERT_EQ(
      run_in(folder.path(), "blender",
             {"-b", "--factory-startup", "-noaudio", "--python-exit-code", "3", "-P", "make.py"}),
      0)
      << read_text(folder.file("blender.log"));
  export_blend(folder.path(), "still");
  export_blend(folder.path(), "moving");

  const auto still = nlohmann::json::parse(read_text(folder.file("out/still.job.json")));
  const auto moving = nlohmann::json::parse(read_text(folder.file("out/moving.job.json")));
  EXPECT_EQ(still["version"], 1);
  EXPECT_EQ(still["scenes"], nlohmann::json::array({"still.glb"}));
  EXPECT_EQ(still["size"], nlohmann::json::array({800, 400}));
  EXPECT_EQ(still["aovs"], nlohmann::json::array({"Z", "mask"}));
  EXPECT_FALSE(still.contains("frames"));
  EXPECT_EQ(moving["frames"], "3-9");
  EXPECT_EQ(moving["fps"], 24);
  EXPECT_EQ(still["cameras"].size(), 3u);

  const auto document = gltf::load(folder.file("out/still.glb"), {});
  ASSERT_TRUE(document) << document.error().to_string();
  const auto scene = scene::flatten(*document, {});
  ASSERT_TRUE(scene) << scene.error().to_string();
  // Blender's (1, 2, 3) is glTF's (1, 3, -2), and the cube reaches 1 from there.
  EXPECT_LT(glm::length(scene->bounds.lower - kernels::Vec3(0, 2, -3)), 1e-5f);
  EXPECT_LT(glm::length(scene->bounds.upper - kernels::Vec3(2, 4, -1)), 1e-5f);
  EXPECT_EQ(scene->triangles.size(), 48u) << "the modifier splits each of six faces in four";
  int known = 0;
  for (const scene::Camera& camera : scene->cameras) {
    EXPECT_NE(std::find(still["cameras"].begin(), still["cameras"].end(), camera.name),
              still["cameras"].end());
    // It stands at Blender's (0, -10, 1), glTF's (0, 1, 10), and looks along glTF's -Z.
    EXPECT_LT(glm::length(camera.matrix[3] - glm::dvec4(0, 1, 10, 1)), 1e-5);
    EXPECT_LT(glm::length(camera.matrix[2] - glm::dvec4(0, 0, 1, 0)), 1e-5);
    if (camera.name == "wide") {
      EXPECT_NEAR(camera.yfov, 2.0 * std::atan(0.25), 1e-6);
      ++known;
    }
    if (camera.name == "tall") {
      EXPECT_NEAR(camera.yfov, 2.0 * std::atan(0.5), 1e-6);
      ++known;
    }
    if (camera.name == "flat") {
      EXPECT_NEAR(camera.ymag, 3.0, 1e-6);
      ++known;
    }
  }
  EXPECT_EQ(known, 3);
  const auto animated = gltf::load(folder.file("out/moving.glb"), {});
  ASSERT_TRUE(animated) << animated.error().to_string();
  EXPECT_EQ(animated->model.animations.size(), 1u);
}

}  // namespace
}  // namespace octrace::test
