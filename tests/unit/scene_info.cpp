#include "backend/scene/scene_info.h"

#include <gtest/gtest.h>

#include <cmath>

#include "backend/scene/builtin.h"
#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::GltfFile;
using testing::json;

TEST(SceneInfo, DescribesADocument) {
  GltfFile file;
  const int indices = file.uint16s("SCALAR", {0, 1, 2, 2, 1, 3});
  const int lift = file.floats("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  const int mesh = file.mesh(
      {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, 4,
      {{"indices", indices}, {"targets", json::array({{{"POSITION", lift}}})}, {"material", 0}});
  file.root["meshes"][mesh]["primitives"].push_back(
      {{"attributes", {{"POSITION", lift}}},
       {"mode", 1},
       {"targets", json::array({{{"POSITION", lift}}})}});
  file.append("nodes", {{"mesh", mesh}, {"children", {2}}});
  file.append("nodes", {{"mesh", mesh}});
  file.append("nodes", {{"camera", 0}, {"translation", {0, 0, 7}}});
  file.append("scenes", {{"name", "main"}, {"nodes", {0, 1}}});
  file.append("scenes", {{"nodes", {1}}});
  file.append("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 1}}}});
  file.append("materials", {{"name", "leaf"}, {"alphaMode", "MASK"}, {"doubleSided", true}});
  file.root["materials"][0]["extensions"]["KHR_materials_unlit"] = json::object();
  file.root["materials"][0]["extensions"]["KHR_materials_clearcoat"] = json::object();
  file.root["extensionsUsed"] = {"KHR_materials_unlit", "KHR_materials_clearcoat",
                                 "KHR_lights_punctual"};
  file.root["extensionsRequired"] = {"KHR_materials_unlit"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] =
      json::array({{{"type", "point"}, {"intensity", 3}}});
  file.append("animations",
              {{"samplers", json::array({{{"input", file.floats("SCALAR", {0.5f, 2.5f})},
                                          {"output", file.floats("VEC3", {0, 0, 0, 1, 1, 1})}}})},
               {"channels",
                json::array({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "scale"}}}}})}});
  file.root["asset"]["generator"] = "by hand";
  const gltf::Document document = file.document();
  const auto scene = flatten(document, {});
  ASSERT_TRUE(scene);
  const SceneInfo info = collect_info(document, *scene);

  EXPECT_EQ(info.generator, "by hand");
  EXPECT_EQ(info.version, "2.0");
  EXPECT_EQ(info.default_scene, 0);
  EXPECT_EQ(info.nodes, 3u);
  ASSERT_EQ(info.scenes.size(), 2u);
  EXPECT_EQ(info.scenes[0].name, "main");
  EXPECT_EQ(info.scenes[0].roots, 2u);
  EXPECT_EQ(info.scenes[0].nodes, 3u);
  EXPECT_EQ(info.scenes[1].nodes, 1u);
  ASSERT_EQ(info.meshes.size(), 1u);
  EXPECT_EQ(info.meshes[0].primitives, 2u);
  EXPECT_EQ(info.meshes[0].points_and_lines, 1u);
  EXPECT_EQ(info.meshes[0].triangles, 2u);
  EXPECT_EQ(info.meshes[0].vertices, 4u);
  EXPECT_EQ(info.meshes[0].morph_targets, 1u);
  EXPECT_EQ(info.meshes[0].instances, 2u);
  EXPECT_EQ(info.meshes[0].attributes, std::vector<std::string>{"POSITION"});
  EXPECT_EQ(info.triangles, 4u);
  EXPECT_EQ(info.objects, 2u);
  EXPECT_EQ(info.geometries, 2u);
  ASSERT_EQ(info.materials.size(), 1u);
  EXPECT_EQ(info.materials[0].alpha_mode, "MASK");
  EXPECT_TRUE(info.materials[0].double_sided);
  EXPECT_TRUE(info.materials[0].unlit);
  EXPECT_EQ(info.materials[0].extensions.size(), 2u);
  ASSERT_EQ(info.lights.size(), 1u);
  EXPECT_EQ(info.lights[0].intensity, 3.0);
  EXPECT_TRUE(std::isinf(info.lights[0].range));
  EXPECT_EQ(info.lights_placed, 0u);
  ASSERT_EQ(info.animations.size(), 1u);
  EXPECT_EQ(info.animations[0].start, 0.5);
  EXPECT_EQ(info.animations[0].end, 2.5);
  EXPECT_EQ(info.animations[0].paths, std::vector<std::string>{"scale"});
  ASSERT_EQ(info.cameras.size(), 1u);
  EXPECT_EQ(info.cameras[0].eye[2], 7.0);
  EXPECT_EQ(info.cameras[0].direction[2], -1.0);
  ASSERT_EQ(info.extensions.size(), 3u);
  EXPECT_EQ(info.extensions[0].name, "KHR_lights_punctual");
  EXPECT_TRUE(info.extensions[0].honoured);
  EXPECT_EQ(info.extensions[1].name, "KHR_materials_clearcoat");
  EXPECT_FALSE(info.extensions[1].honoured);
  EXPECT_FALSE(info.extensions[1].required);
  EXPECT_TRUE(info.extensions[2].honoured);
  EXPECT_TRUE(info.extensions[2].required);
}

TEST(SceneInfo, DescribesABuiltinScene) {
  const Scene scene = make_default_scene();
  const SceneInfo info = collect_info("default", scene);
  EXPECT_EQ(info.source, "builtin:default");
  EXPECT_EQ(info.triangles, scene.triangles.size());
  EXPECT_EQ(info.materials.size(), scene.materials.size());
  EXPECT_EQ(info.objects, scene.object_names.size());
  EXPECT_EQ(info.cameras.size(), 1u);
  EXPECT_EQ(info.lights_placed, 3u);
  EXPECT_EQ(info.textures, 2u);
  EXPECT_GT(info.bytes, scene.triangles.size() * sizeof(kernels::Triangle));
}

}  // namespace
}  // namespace octrace::scene
