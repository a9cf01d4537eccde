#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

// Two triangles side by side; "gone" gives the first a material that hides it.
void write_scene(const std::string& path) {
  write_text(path, R"({"asset":{"version":"2.0"},
    "extensionsUsed":["KHR_materials_variants","KHR_node_visibility"],
    "extensions":{"KHR_materials_variants":{"variants":[{"name":"plain"},{"name":"gone"}]}},
    "scenes":[{"nodes":[0,1,2]}],
    "nodes":[{"mesh":0},{"mesh":1,"translation":[2,0,0]},
             {"mesh":1,"translation":[99,0,0],
              "extensions":{"KHR_node_visibility":{"visible":false}}}],
    "materials":[{"name":"solid"},
                 {"name":"hole","alphaMode":"MASK","alphaCutoff":0.5,
                  "pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0]}}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0,"extensions":{
                 "KHR_materials_variants":{"mappings":[{"material":1,"variants":[1]}]}}}]},
              {"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                  "min":[0,0,0],"max":[1,1,0]}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)"
                   R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})");
}

TEST(Variant, ChangesWhatIsRendered) {
  Scratch scratch;
  write_scene(scratch.path("v.gltf"));
  const auto mask = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {
        "render", scratch.path("v.gltf"),          "--size", "64x48", "--quiet",
        "-o",     scratch.path(name + ".png:mask")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return read_text(scratch.path(name + ".png"));
  };
  const std::string without = mask("without", {});
  EXPECT_EQ(mask("plain", {"--variant", "plain"}), without);
  const std::string gone = mask("gone", {"--variant", "gone"});
  EXPECT_NE(gone, without);
  EXPECT_EQ(mask("one", {"--variant", "1"}), gone);
}

TEST(Variant, IsListedByInfo) {
  Scratch scratch;
  write_scene(scratch.path("v.gltf"));
  const Outcome text = run({"info", scratch.path("v.gltf")});
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_EQ(text.err, "");
  EXPECT_THAT(text.out, HasSubstr("variant 1 \"gone\": changes the material of 1 primitives"));
  EXPECT_THAT(text.out, HasSubstr("hidden: 1 nodes"));
  EXPECT_THAT(text.out, HasSubstr("extension KHR_materials_variants: honoured"));
  const Outcome outcome = run({"info", scratch.path("v.gltf"), "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json info = json::parse(outcome.out);
  EXPECT_EQ(info["variants"], json::parse(R"([{"name": "plain", "primitives": 0},
                                              {"name": "gone", "primitives": 1}])"));
  EXPECT_EQ(info["hidden_nodes"], 1);
  EXPECT_EQ(info["flattened"]["triangles"], 2);
}

TEST(Variant, UnknownOnesAreNamed) {
  Scratch scratch;
  write_scene(scratch.path("v.gltf"));
  Outcome outcome = run({"info", scratch.path("v.gltf"), "--variant", "blue"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("0 \"plain\", 1 \"gone\""));
  outcome = run({"info", "builtin:paper", "--variant", "blue"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("has no variants"));
  outcome = run({"info", scratch.path("v.gltf"), "--variant", ""});
  EXPECT_EQ(outcome.exit_code, 2);
}

// The job's variant, and a scene's own; one that is not there fails with its scene alone.
TEST(Variant, OfABatch) {
  Scratch scratch;
  write_scene(scratch.path("v.gltf"));
  const auto batch = [&](const std::string& members, std::vector<std::string> more = {}) {
    write_text(scratch.path("job.json"),
               R"({"version": 1, "size": [64, 48], "aovs": ["mask"], "cameras": [
                   {"turntable": {"n": 1}}], "output": "out/{scene}.png",)" +
                   members + "}");
    Launch launch;
    launch.folder = scratch.folder();
    launch.arguments = {"batch", "job.json"};
    launch.arguments.insert(launch.arguments.end(), more.begin(), more.end());
    return run(launch);
  };
  const std::string scenes = R"("variant": "gone", "scenes": ["v.gltf",
      {"path": "v.gltf", "name": "plain", "variant": "plain"},
      {"path": "v.gltf", "name": "second", "variant": 1}])";
  const Outcome listed = batch(scenes, {"--dry-run"});
  EXPECT_EQ(listed.out, "out/v.png\nout/plain.png\nout/second.png\n") << listed.err;
  const Outcome made = batch(scenes);
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto image = [&](const std::string& name) {
    return read_text(scratch.path("out/" + name + ".png"));
  };
  EXPECT_EQ(image("v"), image("second"));
  EXPECT_NE(image("v"), image("plain"));

  const Outcome changed = batch(R"("scenes": ["v.gltf",
      {"path": "v.gltf", "name": "plain", "variant": "plain"},
      {"path": "v.gltf", "name": "second", "variant": 1}])");
  EXPECT_EQ(changed.exit_code, 2);
  EXPECT_THAT(changed.err, HasSubstr("/scenes/0/variant was \"gone\", is gone"));

  const Outcome unknown = batch(R"("scenes": [{"path": "v.gltf", "name": "x", "variant": "blue"},
      "v.gltf", {"path": "builtin:paper", "variant": 0}])",
                                {"--force"});
  EXPECT_EQ(unknown.exit_code, 8);
  EXPECT_THAT(unknown.err, HasSubstr("scene 0 (x), 1 views: "));
  EXPECT_THAT(unknown.err, HasSubstr("there is no such variant; the file has 2: 0 \"plain\""));
  EXPECT_THAT(unknown.err, HasSubstr("builtin:paper has no variants"));
  EXPECT_EQ(image("v"), image("plain"));
}

}  // namespace
}  // namespace octrace::test
