// EXT_mesh_gpu_instancing: what is refused, where, and with which code.
#include <gtest/gtest.h>

#include "backend/gltf/document.h"
#include "backend/scene/instances.h"
#include "tests/unit/scene_support.h"

namespace octrace::tests {
namespace {

using scene::testing::GltfFile;
using scene::testing::json;

const std::string kAttributes = "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes";

// A triangle shown twice; each test breaks one thing.
struct InstancingFile : testing::Test {
  InstancingFile() {
    const int mesh = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0});
    json node = {{"mesh", mesh}};
    node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", file.floats("VEC3", {0, 0, 0, 5, 0, 0})},
        {"ROTATION", file.floats("VEC4", {0, 0, 0, 1, 0, 1, 0, 0})},
        {"SCALE", file.floats("VEC3", {1, 1, 1, 2, 2, 2})},
        {"_ID", file.floats("SCALAR", {7, 8})}};
    file.append("nodes", node);
    file.append("scenes", {{"nodes", json::array({0})}});
  }
  json& attributes() {
    return file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
  }
  void expect(const std::string& code, const std::string& pointer, util::Exit exit) {
    const auto document = file.load();
    ASSERT_FALSE(document);
    EXPECT_EQ(document.error().code, code) << document.error().to_string();
    EXPECT_EQ(document.error().pointer, pointer);
    EXPECT_EQ(document.error().exit, exit);
  }
  void expect_invalid(const std::string& code, const std::string& pointer) {
    expect(code, pointer, util::Exit::invalid_input);
  }
  GltfFile file;
};

TEST_F(InstancingFile, IsAcceptedUnbroken) {
  const scene::Scene scene = file.scene();
  ASSERT_TRUE(scene.instancing);
  ASSERT_EQ(scene.instancing->instances.size(), 2u);
  EXPECT_EQ(scene.instancing->instances[1].object, 2u);
  EXPECT_EQ(scene.object_names, (std::vector<std::string>{"node 0", "node 0[0]", "node 0[1]"}));
  EXPECT_TRUE(scene.triangles.empty()) << "the mesh itself is not shown";
  EXPECT_NEAR(scene.bounds.lower.x, 0.0f, 1e-4f);  // turned by half about y: to -x from 5
  EXPECT_NEAR(scene.bounds.upper.x, 5.0f, 1e-4f);
  EXPECT_NEAR(scene.bounds.upper.y, 2.0f, 1e-4f);
}

TEST_F(InstancingFile, QuantisedRotationsAreAccepted) {
  attributes()["ROTATION"] = file.uint16s("VEC4", {0, 0, 0, 32767, 0, 23170, 0, 23170});
  json& accessor = file.root["accessors"].back();
  accessor["componentType"] = 5122;
  accessor["normalized"] = true;
  EXPECT_EQ(file.scene().instancing->instances.size(), 2u);
}

TEST_F(InstancingFile, AttributesMissing) {
  file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = json::object();
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().exit, util::Exit::invalid_input);
}
TEST_F(InstancingFile, AttributesEmpty) {
  attributes() = json::object();
  expect_invalid("EMPTY_ENTITY", kAttributes);
}
TEST_F(InstancingFile, AttributesOfAnotherType) {
  attributes() = json::array({1});
  expect_invalid("TYPE_MISMATCH", kAttributes);
}
TEST_F(InstancingFile, ExtensionOfAnotherType) {
  file.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = 3;
  expect_invalid("TYPE_MISMATCH", "/nodes/0/extensions/EXT_mesh_gpu_instancing");
}
TEST_F(InstancingFile, AccessorThatIsNotThere) {
  attributes()["SCALE"] = 99;
  expect_invalid("UNRESOLVED_REFERENCE", kAttributes + "/SCALE");
}
TEST_F(InstancingFile, AccessorIsNegative) {
  attributes()["_ID"] = -1;
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().pointer, kAttributes + "/_ID");
}
TEST_F(InstancingFile, CountsDiffer) {
  attributes()["SCALE"] = file.floats("VEC3", {1, 1, 1});
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "INSTANCE_UNEQUAL_ACCESSOR_COUNT");
}
TEST_F(InstancingFile, TranslationOfFour) {
  attributes()["TRANSLATION"] = file.floats("VEC4", {0, 0, 0, 1, 0, 0, 0, 1});
  expect_invalid("INSTANCE_ACCESSOR_INVALID_FORMAT", kAttributes + "/TRANSLATION");
}
TEST_F(InstancingFile, RotationOfUnsignedShorts) {
  attributes()["ROTATION"] = file.uint16s("VEC4", {0, 0, 0, 1, 0, 0, 0, 1});
  file.root["accessors"].back()["normalized"] = true;
  expect_invalid("INSTANCE_ACCESSOR_INVALID_FORMAT", kAttributes + "/ROTATION");
}
TEST_F(InstancingFile, RotationOfLengthZero) {
  attributes()["ROTATION"] = file.floats("VEC4", {0, 0, 0, 1, 0, 0, 0, 0});
  expect_invalid("ROTATION_NON_UNIT", kAttributes + "/ROTATION");
}
TEST_F(InstancingFile, RotationWithoutABufferView) {
  file.root["accessors"].push_back({{"componentType", 5126}, {"type", "VEC4"}, {"count", 2}});
  attributes()["ROTATION"] = file.root["accessors"].size() - 1;
  expect_invalid("ROTATION_NON_UNIT", kAttributes + "/ROTATION");
}
TEST_F(InstancingFile, ScaleIsNotANumber) {
  attributes()["SCALE"] = file.floats("VEC3", {1, 1, 1, NAN, 1, 1});
  file.root["accessors"].back().erase("min");
  file.root["accessors"].back().erase("max");
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "ACCESSOR_INVALID_FLOAT");
}
TEST_F(InstancingFile, TwoBillionInstancesOfNothing) {
  file.root["accessors"].push_back(
      {{"componentType", 5126}, {"type", "VEC3"}, {"count", 2000000000}});
  attributes() = {{"TRANSLATION", file.root["accessors"].size() - 1}};
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().exit, util::Exit::limit);
  EXPECT_NE(document.error().message.find("--max-instances"), std::string::npos);
}
TEST_F(InstancingFile, ManyNodesTogetherPassTheLimit) {
  for (int i = 0; i < 3; ++i) {
    file.append("nodes", json(file.root["nodes"][0]));
    file.root["scenes"][0]["nodes"].push_back(i + 1);
  }
  scene::FlattenOptions options;
  options.limits.max_instances = 7;
  const auto scene = scene::flatten(file.document(), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().exit, util::Exit::limit);
  EXPECT_NE(scene.error().message.find("--max-instances"), std::string::npos);
}
TEST_F(InstancingFile, BeyondTheWorld) {
  attributes()["TRANSLATION"] = file.floats("VEC3", {0, 0, 0, 2e9f, 0, 0});
  const auto scene = scene::flatten(file.document(), scene::FlattenOptions{});
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().exit, util::Exit::unsupported);
  EXPECT_EQ(scene.error().pointer, "/nodes/0");
}
TEST_F(InstancingFile, ScaleZeroIsLeftOut) {
  attributes()["SCALE"] = file.floats("VEC3", {0, 0, 0, 2, 2, 2});
  const scene::Scene scene = file.scene();
  ASSERT_EQ(scene.instancing->instances.size(), 1u);
  EXPECT_EQ(scene.instancing->instances[0].object, 2u) << "ids stay";
  ASSERT_EQ(scene.warnings.size(), 1u);
  EXPECT_NE(scene.warnings[0].find("1 of 2 instances"), std::string::npos) << scene.warnings[0];
}
TEST_F(InstancingFile, AFlatMeshNeedsNoThickness) {
  attributes()["SCALE"] = file.floats("VEC3", {1, 1, 0, 2, 2, 0});
  EXPECT_EQ(file.scene().instancing->instances.size(), 2u);
}
TEST_F(InstancingFile, NodeWithoutAMeshShowsNothing) {
  file.root["nodes"][0].erase("mesh");
  const scene::Scene scene = file.scene();
  EXPECT_FALSE(scene.instancing);
}
TEST_F(InstancingFile, CopiesBeyondTheLimit) {
  util::Limits limits;
  limits.max_triangles = 1;
  const auto baked = scene::bake_instances(file.scene(), limits);
  ASSERT_FALSE(baked);
  EXPECT_EQ(baked.error().exit, util::Exit::limit);
  EXPECT_NE(baked.error().message.find("--max-triangles"), std::string::npos);
}

}  // namespace
}  // namespace octrace::tests
