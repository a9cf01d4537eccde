#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "exporters/blender/blender.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {
namespace {

using exporters::BlenderScene;
using exporters::BlenderView;

// The job as Python would read it: the literal is JSON text inside a JSON string.
nlohmann::json job_of(const std::string& script) {
  const std::string before = "JOB = json.loads(";
  const std::size_t begin = script.find(before) + before.size();
  const std::size_t end = script.find(")\n", begin);
  return nlohmann::json::parse(
      nlohmann::json::parse(script.substr(begin, end - begin)).get<std::string>());
}

TEST(BlenderScript, CarriesTheJobWhateverItsNamesHold) {
  const TemporaryFolder folder;
  BlenderView view;
  view.camera = look_at({3, 2, 5}, {0, 0, 0}, 0.7);
  view.width = 123;
  view.height = 45;
  view.output = "out \"quoted\" \\ ''' # {x} \n ☃ 😀.exr";
  BlenderScene scene;
  scene.file = "/a b/\"\"\"); raise SystemExit #.glb";
  scene.gltf_scene = 2;
  scene.cull = false;
  scene.views = {view, view};
  const auto written = exporters::write_blender({scene}, folder.file("job.py"));
  ASSERT_TRUE(written) << written.error().to_string();
  const std::string script = read_text(folder.file("job.py"));
  for (const char c : script.substr(0, script.find("\n\n# Renders"))) {
    ASSERT_LT(static_cast<unsigned char>(c), 0x7f);
  }
  const nlohmann::json job = job_of(script);
  ASSERT_EQ(job["scenes"].size(), 1u);
  EXPECT_EQ(job["scenes"][0]["file"], scene.file);
  EXPECT_EQ(job["scenes"][0]["gltf_scene"], 2);
  EXPECT_EQ(job["scenes"][0]["cull"], false);
  EXPECT_EQ(job["scenes"][0]["alpha"], true);
  ASSERT_EQ(job["scenes"][0]["views"].size(), 2u);
  const nlohmann::json& first = job["scenes"][0]["views"][0];
  EXPECT_EQ(first["output"], view.output);
  EXPECT_EQ(first["width"], 123);
  EXPECT_EQ(first["type"], "perspective");
  EXPECT_EQ(first["matrix"][12], 3.0);
  EXPECT_NEAR(first["top"].get<double>(), std::tan(0.35), 1e-15);
  EXPECT_NE(script.find("\nmain(JOB)\n"), std::string::npos);
}

TEST(BlenderScript, RefusesPathsThatPythonTextCannotHold) {
  const TemporaryFolder folder;
  BlenderScene scene;
  scene.file = "\xff\xfe.glb";
  const auto written = exporters::write_blender({scene}, folder.file("job.py"));
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().exit, util::Exit::unsupported);
}

TEST(BlenderScript, ClipPlanesKeepTheSceneAndTheCamerasOwnPlanes) {
  scene::Scene scene;
  add_material(scene, {});
  add_part(scene, box("box", {0, 0, 0}, {1, 2, 3}));
  finish(scene);
  BlenderView view;
  view.camera = look_at({0, 0, 10}, {0, 0, 0}, 0.7);
  exporters::blender_clip(scene.bounds, view);
  EXPECT_GT(view.clip_start, 0.0);
  EXPECT_LT(view.clip_start, 1e-3);
  EXPECT_GT(view.clip_end, 13.2);
  view.camera.znear = 8.0;
  view.camera.zfar = 11.0;
  exporters::blender_clip(scene.bounds, view);
  EXPECT_EQ(view.clip_start, 8.0);
  EXPECT_EQ(view.clip_end, 11.0);
}

}  // namespace
}  // namespace octrace::test
