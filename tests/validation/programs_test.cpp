// octrace validate and octrace compare as their users meet them: the program itself, with the real
// reference programs where they are installed and with broken ones in their place.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "backend/image/image.h"
#include "backend/util/atomic_file.h"
#include "tests/property/animated_scenes.h"
#include "tests/validation/bug_scene.h"
#include "tests/validation/synthetic.h"
#include "validation/reference/process.h"
#include "validation/reference/scratch.h"

namespace octrace::validation::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class Octrace : public testing::Test {
 protected:
  void SetUp() override {
    auto scratch = Scratch::create("octrace-test");
    ASSERT_TRUE(scratch);
    scratch_.emplace(std::move(*scratch));
    // Whatever the program leaves in its scratch folders must be gone in the end.
    fs::create_directory(file("tmp"));
    ASSERT_EQ(::setenv("TMPDIR", file("tmp").c_str(), 1), 0);
    ASSERT_TRUE(util::write_file(file("scene.gltf"), bug_scene().dump()));
  }

  void TearDown() override { ::unsetenv("TMPDIR"); }

  std::string file(const std::string& name) { return scratch_->file(name); }

  struct Outcome {
    int code;
    std::string text;  // standard output and standard error
  };
  Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), OCTRACE_PROGRAM);
    const auto result = run_process({.arguments = arguments,
                                     .folder = scratch_->path(),
                                     .log = file("log"),
                                     .timeout = std::chrono::minutes(5)});
    EXPECT_TRUE(result) << (result ? "" : result.error().to_string());
    std::ifstream stream(file("log"));
    EXPECT_TRUE(fs::is_empty(file("tmp"))) << "a scratch folder is left";
    return {result ? result->exit_code : -1, {std::istreambuf_iterator<char>(stream), {}}};
  }

  // A shell script under the name of a program; --version answers as the program would.
  std::string fake(const std::string& name, const std::string& script) {
    const std::string path = file(name);
    EXPECT_TRUE(util::write_file(
        path, "#!/bin/sh\nif [ \"$1\" = --version ]; then echo Blender 0; exit 0; fi\n" + script));
    fs::permissions(path, fs::perms::owner_all);
    return path;
  }

  json report(const std::string& folder) {
    std::ifstream stream(file(folder + "/report.json"));
    return json::parse(stream, nullptr, false);
  }

  std::optional<Scratch> scratch_;
};

using Validate = Octrace;
using Compare = Octrace;

TEST_F(Validate, AMissingProgramIsSaidBeforeAnyWork) {
  const Outcome outcome = run({"validate", "scene.gltf", "--povray", "octrace-no-povray"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_NE(outcome.text.find("octrace-no-povray"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("--povray"), std::string::npos) << outcome.text;
}

TEST_F(Validate, AFailingProgramIsNamedWithItsLog) {
  const std::string program = fake("povray", "echo first; echo no memory for mesh2 >&2; exit 3\n");
  const Outcome outcome =
      run({"validate", "scene.gltf", "--against", "povray", "--povray", program});
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.text.find(program), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("exit code 3"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("no memory for mesh2"), std::string::npos) << outcome.text;
}

TEST_F(Validate, AProgramThatWritesNothingHasNotSucceeded) {
  for (const char* script : {"exit 0\n", "for f in view0 view1 view2; do : > $f.png; done\n"}) {
    const Outcome outcome =
        run({"validate", "scene.gltf", "--against", "povray", "--povray", fake("povray", script)});
    EXPECT_EQ(outcome.code, 5) << script;
    EXPECT_NE(outcome.text.find("1 not compared"), std::string::npos) << outcome.text;
  }
  const Outcome outcome = run(
      {"validate", "scene.gltf", "--against", "blender", "--blender", fake("blender", "exit 0\n")});
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.text.find("wrote no image"), std::string::npos) << outcome.text;
}

TEST_F(Validate, AHangingProgramIsStopped) {
  const std::string program = fake("blender", "sleep 600 & sleep 600\n");
  const Outcome outcome = run(
      {"validate", "scene.gltf", "--against", "blender", "--blender", program, "--timeout", "1"});
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.text.find("time limit of 1 s"), std::string::npos) << outcome.text;
}

TEST_F(Validate, ABadSceneDoesNotStopTheOthers) {
  ASSERT_TRUE(util::write_file(file("bad.gltf"), "{"));
  const Outcome outcome = run({"validate", "bad.gltf", "scene.gltf", "--against", "povray",
                               "--povray", fake("povray", "exit 3\n"), "--report", "report"});
  EXPECT_EQ(outcome.code, 3);  // the first failure's
  const json found = report("report");
  ASSERT_EQ(found["comparisons"].size(), 2u);
  EXPECT_EQ(found["totals"]["errors"], 2);
}

TEST_F(Validate, WrongOptionsAreUsageErrors) {
  EXPECT_EQ(run({"validate"}).code, 2);
  EXPECT_EQ(run({"validate", "scene.gltf", "--against", "mitsuba"}).code, 2);
  EXPECT_EQ(run({"validate", "scene.gltf", "--size", "640"}).code, 2);
  EXPECT_EQ(run({"validate", "scene.gltf", "--tolerance", "no-such=1"}).code, 2);
}

void write_depth(const std::string& path, const Planes& planes) {
  image::ImageView view;
  view.width = planes.width;
  view.height = planes.height;
  view.channels.push_back({"Z", image::SampleType::float32, planes.z.data(), 4});
  ASSERT_TRUE(image::write_exr(path, view));
}

TEST_F(Compare, EqualAndDifferentImages) {
  Planes changed = disc();
  erase(changed, 80, 60);
  erase(changed, 82, 60);
  write_depth(file("a.exr"), disc());
  write_depth(file("b.exr"), changed);
  EXPECT_EQ(run({"compare", "a.exr", "a.exr"}).code, 0);
  const Outcome outcome = run({"compare", "b.exr", "a.exr", "--report", "report"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.text.find("(80, 60)"), std::string::npos) << outcome.text;
  EXPECT_EQ(report("report")["comparisons"][0]["geometry"]["mask_far"], 2);
  EXPECT_TRUE(fs::exists(file("report/index.html")));
  EXPECT_EQ(run({"compare", "b.exr", "a.exr", "--tolerance", "mask-far=2", "--tolerance",
                 "iou=0.99", "--tolerance", "mask-total=2"})
                .code,
            0);
}

TEST_F(Compare, APictureInSrgbIsTheSameAsInLinearLight) {
  std::vector<float> rgba;
  for (int i = 0; i < 64 * 48; ++i) {
    for (const float value : {float(i % 64) / 64, float(i / 64) / 48, 0.25f, 1.0f}) {
      rgba.push_back(value);
    }
  }
  image::ImageView view;
  view.width = 64;
  view.height = 48;
  for (std::size_t c = 0; c < 4; ++c) {
    view.channels.push_back({std::string(1, "RGBA"[c]), image::SampleType::float32, &rgba[c], 16});
  }
  ASSERT_TRUE(image::write_exr(file("a.exr"), view));
  ASSERT_TRUE(image::write_integer(file("a.png"), view, image::Encoding::srgb8, 1.0));
  const Outcome outcome =
      run({"compare", "a.png", "a.exr", "--tolerance", "rmse=0.003", "--tolerance", "flip=0.02"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("FLIP"), std::string::npos) << outcome.text;
}

TEST_F(Compare, MissingAndUnreadableImages) {
  write_depth(file("a.exr"), disc());
  EXPECT_EQ(run({"compare", "a.exr", "missing.exr"}).code, 5);
  ASSERT_TRUE(util::write_file(file("broken.exr"), "not an image"));
  EXPECT_NE(run({"compare", "broken.exr", "a.exr"}).code, 0);
  Planes small = disc();
  small.width = kHeight;
  small.height = kWidth;
  write_depth(file("small.exr"), small);
  EXPECT_EQ(run({"compare", "small.exr", "a.exr"}).code, 3);
}

class RealPrograms : public Octrace {
 protected:
  void SetUp() override {
    Octrace::SetUp();
    for (const char* program : {"povray", "blender"}) {
      if (!find_program(program)) GTEST_SKIP() << program << " is not installed";
    }
  }
  // Every comparison agrees, and there are as many as there should be.
  void expect_agreement(std::vector<std::string> arguments, std::size_t comparisons) {
    arguments.insert(arguments.end(), {"--jobs", "2", "--report", "report"});
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.text;
    const json found = report("report");
    EXPECT_EQ(found["totals"]["agree"], comparisons) << outcome.text;
    EXPECT_EQ(found["totals"]["comparisons"], comparisons);
  }
};

TEST_F(RealPrograms, AgreeOnOurOwnScenes) {
  const auto animated = tests::animated_scenes();
  const auto instances = std::find_if(animated.begin(), animated.end(),
                                      [](const auto& scene) { return scene.name == "instances"; });
  ASSERT_NE(instances, animated.end());
  ASSERT_TRUE(util::write_file(file("instances.gltf"), instances->file.text()));
  // An orthographic camera of the file's own, the built-in scenes' cameras, framings of instances.
  expect_agreement({"validate", "scene.gltf", "builtin:default", "builtin:paper", "instances.gltf"},
                   18);
}

TEST_F(RealPrograms, AgreeOnOtherPeoplesScenes) {
  const fs::path shared = fs::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!fs::exists(shared)) GTEST_SKIP() << shared << " is missing";
  std::vector<std::string> arguments{"validate"};
  for (const char* scene :
       {"01_alpha_mask/01_alpha_mask.gltf",
        "01_single_vs_double_sided/01_single_vs_double_sided.gltf",
        "02_node_hierarchy/02_node_hierarchy.gltf", "simple_skin/simple_skin.gltf",
        "AnimatedMorphSphere/AnimatedMorphSphere.gltf",
        "Mesh_PrimitiveMode_05/Mesh_PrimitiveMode_05.gltf"}) {
    arguments.push_back(fs::absolute(shared / scene).string());
  }
  expect_agreement(std::move(arguments), 36);
}

// Blender evaluates the animations itself, with its own importer. At keys it has what glTF has: the
// first, the last and one between of every animation of every shared scene.
TEST_F(RealPrograms, BlenderAgreesAtKeyTimes) {
  const fs::path shared = fs::path(OCTRACE_SHARED_SCENES) / "valid";
  if (!fs::exists(shared)) GTEST_SKIP() << shared << " is missing";
  const std::string three = fs::absolute(shared / "03_all_animations/03_all_animations.gltf");
  std::vector<std::string> arguments{"validate", three};
  for (const char* scene :
       {"01_morphed_cube/01_morphed_cube.gltf", "03_animated_cube/03_animated_cube.gltf",
        "03_skinned_cylinder/03_skinned_cylinder.gltf",
        "AnimatedMorphSphere/AnimatedMorphSphere.gltf", "CesiumMilkTruck/CesiumMilkTruck.glb",
        "simple_skin/simple_skin.gltf"}) {
    arguments.push_back(fs::absolute(shared / scene).string());
  }
  const std::vector<std::string> common{"--against", "blender", "--size", "160x120"};
  arguments.insert(arguments.end(), common.begin(), common.end());
  arguments.insert(arguments.end(), {"--keys", "3"});
  expect_agreement(std::move(arguments), 9 * 3 * 3);
  for (const std::vector<std::string>& at :
       {std::vector<std::string>{"--frame", "24"}, {"--time", "1", "--animation", "CubeAction"}}) {
    std::vector<std::string> chosen{"validate", three};
    chosen.insert(chosen.end(), common.begin(), common.end());
    chosen.insert(chosen.end(), at.begin(), at.end());
    expect_agreement(std::move(chosen), 3);
  }
}

// Every path and interpolation, mirrors, two sets of joints, sparse targets, weights beyond [0, 1]:
// at the first keys, and held after the last ones.
TEST_F(RealPrograms, BlenderAgreesAtTheEndsOfOurOwnAnimations) {
  std::vector<std::string> arguments{"validate"};
  for (const tests::AnimatedScene& scene : tests::animated_scenes()) {
    std::ofstream(file(scene.name + ".gltf")) << scene.file.text();
    arguments.push_back(scene.name + ".gltf");
  }
  arguments.insert(arguments.end(), {"--against", "blender", "--size", "160x120", "--time"});
  for (const char* time : {"0", "100"}) {
    std::vector<std::string> at = arguments;
    at.emplace_back(time);
    expect_agreement(std::move(at), 16);
  }
}

TEST_F(RealPrograms, ABugIsAnExitCode) {
  // What octrace and POV-Ray see without culling is not what they see with it.
  const Outcome good = run({"export", "scene.gltf", "--to", "povray", "--mode", "depth", "-o",
                            "pov", "--size", "320x240"});
  ASSERT_EQ(good.code, 0) << good.text;
  json side;
  for (const auto& entry : fs::directory_iterator(file("pov"))) {
    if (entry.path().extension() != ".json") continue;
    std::ifstream stream(entry.path());
    side = json::parse(stream, nullptr, false);
  }
  ASSERT_EQ(side["mode"], "depth");
  std::vector<std::string> arguments{"povray"};
  for (const json& argument : side["arguments"]) arguments.push_back(argument);
  const auto povray =
      run_process({.arguments = arguments, .folder = file("pov"), .log = file("povray.log")});
  ASSERT_TRUE(povray);
  ASSERT_EQ(povray->exit_code, 0) << log_tail(file("povray.log"));
  for (const auto& [cull, code] : {std::pair{"spec", 0}, std::pair{"none", 1}}) {
    ASSERT_EQ(run({"render", "scene.gltf", "-o", "ours.exr", "--aov", "Z,mask,object_id", "--cull",
                   cull, "--size", "320x240"})
                  .code,
              0);
    const Outcome outcome = run({"compare", "ours.exr", "pov/" + side["image"].get<std::string>()});
    EXPECT_EQ(outcome.code, code) << outcome.text;
  }
}

}  // namespace
}  // namespace octrace::validation::test
