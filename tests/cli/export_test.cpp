#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

Outcome run_in_folder(const Scratch& scratch, std::vector<std::string> arguments) {
  Launch launch;
  launch.arguments = std::move(arguments);
  launch.folder = scratch.folder();
  return run(launch);
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST(Export, HelpHasExamples) {
  const Outcome help = run({"export", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, HasSubstr("Examples:"));
  EXPECT_THAT(help.out, HasSubstr("povray|blender|gltf"));
}

TEST(Export, WritesWhatItSaysAndHowToRenderIt) {
  const Scratch scratch;
  const Outcome depth = run_in_folder(
      scratch, {"export", "builtin:paper", "--to", "povray", "-o", "a/b", "--size", "64x48"});
  EXPECT_EQ(depth.exit_code, 0) << depth.err;
  EXPECT_THAT(names_in(scratch.path("a/b")), ElementsAre("paper.pov", "paper_povray.json"));
  EXPECT_THAT(depth.out, HasSubstr("a/b/paper.pov\n"));
  EXPECT_THAT(depth.out, HasSubstr("povray +Ipaper.pov +Opaper_povray.png +W64 +H48"));
  const auto side = nlohmann::json::parse(read_text(scratch.path("a/b/paper_povray.json")));
  EXPECT_EQ(side["mode"], "depth");
  EXPECT_GT(side["far"].get<double>(), 0.0);

  const Outcome blender =
      run_in_folder(scratch, {"export", "builtin:paper", "--to", "blender", "-o", "c"});
  EXPECT_EQ(blender.exit_code, 0) << blender.err;
  EXPECT_THAT(names_in(scratch.path("c")), ElementsAre("paper.glb", "paper.py"));
  EXPECT_THAT(blender.out, HasSubstr("--python-exit-code 3 -P paper.py"));
}

TEST(Export, AGlbComesBackTheSame) {
  const Scratch scratch;
  EXPECT_EQ(
      run_in_folder(scratch, {"export", "builtin:default", "--to", "gltf", "-o", "."}).exit_code,
      0);
  const Outcome info = run_in_folder(scratch, {"info", "default.glb", "--json"});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  const Outcome original = run_in_folder(scratch, {"info", "builtin:default", "--json"});
  const auto a = nlohmann::json::parse(original.out), b = nlohmann::json::parse(info.out);
  ASSERT_TRUE(a.contains("flattened"));
  EXPECT_EQ(a["flattened"]["triangles"], b["flattened"]["triangles"]);
  EXPECT_EQ(a["flattened"]["bounds"], b["flattened"]["bounds"]);
  EXPECT_EQ(a["octree"], b["octree"]);
}

TEST(Export, NeverWritesOverTheSceneItself) {
  const Scratch scratch;
  ASSERT_EQ(
      run_in_folder(scratch, {"export", "builtin:paper", "--to", "gltf", "-o", "."}).exit_code, 0);
  const std::string before = read_text(scratch.path("paper.glb"));
  const Outcome again = run_in_folder(scratch, {"export", "paper.glb", "--to", "gltf", "-o", "."});
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.err, HasSubstr("over the scene itself"));
  EXPECT_EQ(read_text(scratch.path("paper.glb")), before);
}

TEST(Export, WrongCommandLinesAndPlacesAreNamed) {
  const Scratch scratch;
  write_text(scratch.path("file"), "");
  struct {
    std::vector<std::string> arguments;
    int exit_code;
    std::string said;
  } const cases[] = {
      {{"--to", "maya", "-o", "x"}, 2, "maya"},
      {{"-o", "x"}, 2, "--to"},
      {{"--to", "povray"}, 2, "--output"},
      {{"--to", "povray", "-o", "x", "--camera", "nope"}, 2, "no such camera"},
      {{"--to", "povray", "-o", "x", "--size", "0x9"}, 2, "--size"},
      {{"--to", "povray", "-o", "file"}, 5, "folder cannot be made"},
      {{"--to", "gltf", "-o", "file/below"}, 5, "folder cannot be made"},
  };
  for (const auto& wrong : cases) {
    std::vector<std::string> arguments{"export", "builtin:paper"};
    arguments.insert(arguments.end(), wrong.arguments.begin(), wrong.arguments.end());
    const Outcome outcome = run_in_folder(scratch, arguments);
    EXPECT_EQ(outcome.exit_code, wrong.exit_code) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(wrong.said));
    EXPECT_FALSE(fs::exists(scratch.path("x")));
  }
}

TEST(Export, AFullDiskLeavesNoHalfFile) {
  for (const char* target : {"povray", "gltf", "blender"}) {
    const Scratch scratch;
    Launch launch;
    launch.arguments = {"export", "builtin:default", "--to", target, "-o", "out"};
    launch.folder = scratch.folder();
    launch.largest_file = 4096;
    const Outcome outcome = run(launch);
    EXPECT_EQ(outcome.exit_code, 5) << outcome.err;
    for (const std::string& name : names_in(scratch.path("out"))) {
      EXPECT_FALSE(name.ends_with(".pov") || name.ends_with(".glb") || name.ends_with(".py"))
          << name;
      EXPECT_NE(name.front(), '.') << name << " was left behind";
    }
  }
}

}  // namespace
}  // namespace octrace::test
