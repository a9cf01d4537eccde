#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

TEST(Info, PaperSceneHasTheSeedsCounts) {
  const Outcome outcome = run({"info", "builtin:paper", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const json info = json::parse(outcome.out);
  EXPECT_EQ(info["source"], "builtin:paper");
  EXPECT_EQ(info["flattened"]["vertices"], 855);
  EXPECT_EQ(info["flattened"]["triangles"], 1692);
  EXPECT_EQ(info["octree"]["triangles"], 1692);
  EXPECT_GT(info["octree"]["nodes"], 10);
  EXPECT_LE(info["octree"]["depth"], 32);
  EXPECT_LT(info["flattened"]["bounds"]["lower"][0], info["flattened"]["bounds"]["upper"][0]);
}

TEST(Info, TextSaysTheSame) {
  const Outcome outcome = run({"info", "builtin:paper"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("1692 triangles, 855 vertices"));
  EXPECT_THAT(outcome.out, HasSubstr("camera 0"));
}

TEST(Info, BuilderAndLeafShowInTheOctree) {
  const auto nodes = [](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"info", "builtin:paper", "--json", "--verify"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return json::parse(outcome.out)["octree"]["nodes"].get<int>();
  };
  EXPECT_NE(nodes({"--builder", "median"}), nodes({"--builder", "sah"}));
  EXPECT_GT(nodes({"--builder", "median", "--leaf", "4"}),
            nodes({"--builder", "median", "--leaf", "64"}));
}

// One triangle, written here, with names that a terminal must not obey.
TEST(Info, ReportsAFilesOwnStructure) {
  Scratch scratch;
  write_text(scratch.path("t.gltf"), R"({"asset":{"version":"2.0","generator":"hand\u001b[31m"},
    "extensionsUsed":["KHR_materials_unlit","EXT_nobody_knows"],
    "scene":1,"scenes":[{"name":"first"},{"name":"second","nodes":[0,1]}],
    "nodes":[{"mesh":0},{"mesh":0,"translation":[5,0,0]}],
    "meshes":[{"name":"tri","primitives":[{"attributes":{"POSITION":0},"material":0}]}],
    "materials":[{"name":"paint","doubleSided":true,"extensions":{"KHR_materials_unlit":{}}}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                  "min":[0,0,0],"max":[1,1,0]}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)"
                                     R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})");
  const Outcome outcome = run({"info", scratch.path("t.gltf"), "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("EXT_nobody_knows"));
  const json info = json::parse(outcome.out);
  EXPECT_EQ(info["default_scene"], 1);
  EXPECT_EQ(info["scenes"].size(), 2u);
  EXPECT_EQ(info["scenes"][1]["nodes"], 2);
  EXPECT_EQ(info["meshes"][0]["instances"], 2);
  EXPECT_EQ(info["meshes"][0]["triangles"], 1);
  EXPECT_EQ(info["flattened"]["triangles"], 2);
  EXPECT_EQ(info["materials"][0]["double_sided"], true);
  EXPECT_EQ(info["flattened"]["bounds"]["upper"][0], 6.0);
  for (const json& extension : info["extensions"]) {
    EXPECT_EQ(extension["honoured"], extension["name"] == "KHR_materials_unlit");
  }
  const Outcome text = run({"info", scratch.path("t.gltf"), "--quiet"});
  EXPECT_EQ(text.err, "");
  EXPECT_EQ(text.out.find('\x1b'), std::string::npos);
  EXPECT_THAT(text.out, HasSubstr("\"hand\\x1b[31m\""));
}

}  // namespace
}  // namespace octrace::test
