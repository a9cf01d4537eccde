// --time, --frame, --fps and --animation, as a user meets them.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "backend/image/image.h"
#include "tests/cli/driver.h"
#include "tests/property/animated_scenes.h"

namespace octrace::test {
namespace {

using ::testing::HasSubstr;

class TimeOptions : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const tests::AnimatedScene& scene : tests::animated_scenes()) {
      write_text(scratch_.path(scene.name + ".gltf"), scene.file.text());
    }
  }
  Outcome octrace(std::vector<std::string> arguments) const {
    Launch launch;
    launch.arguments = std::move(arguments);
    launch.folder = scratch_.folder();
    return run(launch);
  }
  // Every plane of a small render.
  image::Image render(const std::string& scene, std::vector<std::string> more) const {
    std::vector<std::string> arguments{"render", scene,   "-o",    "image.exr", "--aov",  "all",
                                       "--size", "48x36", "--spp", "1",         "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = octrace(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    auto image = image::read(scratch_.path("image.exr"), {});
    EXPECT_TRUE(image);
    return std::move(*image);
  }
  Scratch scratch_;
};

bool same(const image::Image& a, const image::Image& b, const std::string& plane) {
  return a.find(plane)->floats == b.find(plane)->floats;
}

TEST_F(TimeOptions, AFrameIsATime) {
  const image::Image time = render("morphs.gltf", {"--time", "0.5"});
  for (const auto& [frame, fps] : {std::pair{"12", "24"}, {"15", "30"}, {"1", "2"}}) {
    EXPECT_TRUE(same(time, render("morphs.gltf", {"--frame", frame, "--fps", fps}), "Z")) << fps;
  }
  EXPECT_TRUE(same(time, render("morphs.gltf", {"--frame", "12"}), "Z"));
  EXPECT_FALSE(same(time, render("morphs.gltf", {"--frame", "13"}), "Z"));
}

TEST_F(TimeOptions, WithoutThemTheSceneIsAtRest) {
  const image::Image rest = render("hierarchy.gltf", {});
  EXPECT_TRUE(same(rest, render("hierarchy.gltf", {"--time", "1", "--animation", "none"}), "Z"));
  EXPECT_TRUE(same(rest, render("hierarchy.gltf", {"--fps", "30"}), "Z"));
  const image::Image first = render("hierarchy.gltf", {"--frame", "0"});
  EXPECT_FALSE(same(rest, first, "Z"));
  EXPECT_TRUE(same(first, render("hierarchy.gltf", {"--animation", "0"}), "Z"));
  // A scene that does not move takes any time.
  EXPECT_EQ(
      octrace({"render", "builtin:paper", "--time", "5", "-o", "a.png", "--size", "8x8"}).exit_code,
      0);
}

TEST_F(TimeOptions, MotionIsToTheNextFrame) {
  const auto moves = [](const image::Image& image) {
    const auto& x = image.find("motion.X")->floats;
    return std::any_of(x.begin(), x.end(), [](float value) { return value != 0.0f; });
  };
  EXPECT_FALSE(moves(render("rotations.gltf", {})));
  const image::Image slow = render("rotations.gltf", {"--time", "0.1", "--fps", "1000"});
  const image::Image fast = render("rotations.gltf", {"--time", "0.1", "--fps", "10"});
  EXPECT_TRUE(moves(slow));
  const auto largest = [](const image::Image& image) {
    float most = 0.0f;
    for (const float value : image.find("motion.X")->floats) most = std::max(most, std::abs(value));
    return most;
  };
  EXPECT_GT(largest(fast), 10.0f * largest(slow));
  EXPECT_FALSE(moves(render("rotations.gltf", {"--time", "50"})));  // after the last key
  // The camera's own motion reaches the background's neighbours, not the background.
  EXPECT_TRUE(moves(render("skin_morph_and_camera.gltf", {"--time", "0.5"})));
}

TEST_F(TimeOptions, BadOnesAreUsageErrors) {
  const auto expect_usage = [&](std::vector<std::string> more, const char* text) {
    std::vector<std::string> arguments{"render", "hierarchy.gltf", "-o", "a.exr"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = octrace(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << ::testing::PrintToString(more);
    EXPECT_THAT(outcome.err, HasSubstr(text));
  };
  expect_usage({"--time", "nan"}, "finite");
  expect_usage({"--time", "inf"}, "finite");
  expect_usage({"--time", "soon"}, "finite");
  expect_usage({"--time", "1", "--frame", "2"}, "--frame");
  expect_usage({"--frame", "1.5"}, "--frame");
  expect_usage({"--frame", "1", "--fps", "0"}, "--fps");
  expect_usage({"--time", "1", "--animation", "walk"}, "0 \"animation 0\"");
  expect_usage({"--time", "1", "--animation", "7"}, "there is no such animation");
  std::vector<std::string> png{"render", "hierarchy.gltf", "-o", "a.png:motion"};
  const Outcome outcome = octrace(png);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("motion needs floating point"));
}

TEST_F(TimeOptions, ABakedSceneIsTheSceneAtThatTime) {
  for (const char* name : {"skin_of_two_sets", "morphs", "hierarchy"}) {
    const std::string scene = std::string(name) + ".gltf";
    const Outcome baked =
        octrace({"export", scene, "--to", "gltf", "--time", "0.7", "-o", "baked"});
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
    const image::Image a = render(scene, {"--time", "0.7"});
    const image::Image b = render("baked/" + std::string(name) + ".glb", {});
    for (const char* plane : {"Z", "mask", "N.X"}) EXPECT_TRUE(same(a, b, plane)) << name << plane;
  }
}

TEST_F(TimeOptions, BlenderIsGivenTheBakedScene) {
  const Outcome blender =
      octrace({"export", "morphs.gltf", "--to", "blender", "--frame", "3", "-o", "b"});
  ASSERT_EQ(blender.exit_code, 0) << blender.err;
  EXPECT_TRUE(std::filesystem::exists(scratch_.path("b/morphs.glb")));
  const Outcome rest = octrace({"export", "morphs.gltf", "--to", "blender", "-o", "r"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_FALSE(std::filesystem::exists(scratch_.path("r/morphs.glb")));
}

TEST_F(TimeOptions, InfoNamesAnimationsAndTakesATime) {
  const Outcome rest = octrace({"info", "hierarchy.gltf", "--json"});
  const Outcome later = octrace({"info", "hierarchy.gltf", "--json", "--time", "1.9"});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  ASSERT_EQ(later.exit_code, 0) << later.err;
  const auto a = nlohmann::json::parse(rest.out), b = nlohmann::json::parse(later.out);
  EXPECT_NE(a["flattened"]["bounds"], b["flattened"]["bounds"]);
  ASSERT_EQ(a["animations"].size(), 1u);
  EXPECT_EQ(a["animations"][0]["channels"], 6);
  EXPECT_EQ(a["animations"][0]["end"], 2.0);
  ASSERT_EQ(a["animations"][0]["targets"].size(), 6u);
  const auto& target = a["animations"][0]["targets"][1];
  EXPECT_EQ(target["node"], 0);
  EXPECT_EQ(target["path"], "rotation");
  EXPECT_EQ(target["interpolation"], "LINEAR");
  EXPECT_EQ(target["keys"], 3);
  const Outcome text = octrace({"info", "hierarchy.gltf"});
  EXPECT_THAT(text.out,
              HasSubstr("animation 0 \"animation 0\": 0 s to 2 s, 6 channels of 3 nodes"));
}

// Of each view and frame the very file that a render of its own writes; the job goes over the
// frames with gaps, so that its scene is moved, and not opened, at each.
TEST_F(TimeOptions, ABatchHasTheMotionOfARender) {
  write_text(scratch_.path("view.json"),
             R"({"name": "view", "type": "perspective", "yfov": 0.9, "znear": 0.01,
                 "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.3, 0.8, 4, 1]})");
  struct Job {
    std::string scenes, cameras, animation;
    std::vector<std::string> names;
  };
  const std::vector<Job> jobs = {
      {R"("hierarchy.gltf", "rotations.gltf", "skin_of_two_sets.gltf", "morphs.gltf")",
       R"("view.json")",
       "",
       {"hierarchy", "rotations", "skin_of_two_sets", "morphs"}},
      {R"("skin_morph_and_camera.gltf")", R"("eye", "view.json")", "", {"skin_morph_and_camera"}},
      {R"("morphs.gltf")", R"("view.json")", R"("animation": "none",)", {"morphs"}}};
  for (const Job& job : jobs) {
    write_text(scratch_.path("job.json"),
               R"({"version": 1, "frames": "2-3,7", "fps": 10, "size": [48, 36],
                   "aovs": ["Z", "motion"], "output": "out/{scene}_{camera}_{frame}_{aov}.npy",)" +
                   job.animation + R"("scenes": [)" + job.scenes + R"(], "cameras": [)" +
                   job.cameras + "]}");
    const Outcome batch = octrace({"batch", "job.json", "--force"});
    ASSERT_EQ(batch.exit_code, 0) << batch.err;
    for (const std::string& name : job.names) {
      const bool eye = name == "skin_morph_and_camera", still = !job.animation.empty();
      for (const char* camera : eye ? std::vector{"eye", "view"} : std::vector{"view"}) {
        std::set<std::string> motions;
        for (const char* frame : {"2", "3", "7"}) {
          std::vector<std::string> arguments = {
              "render",   name + ".gltf",
              "--frame",  frame,
              "--fps",    "10",
              "--size",   "48x36",
              "--camera", std::string(camera) == "eye" ? "eye" : "view.json",
              "-o",       "Z.npy:Z",
              "-o",       "motion.npy:motion",
              "--quiet"};
          if (still) arguments.insert(arguments.end(), {"--animation", "none"});
          const Outcome alone = octrace(arguments);
          ASSERT_EQ(alone.exit_code, 0) << alone.err;
          for (const char* plane : {"Z", "motion"}) {
            const std::string file = fmt::format("{}_{}_{}_{}.npy", name, camera, frame, plane);
            EXPECT_EQ(read_text(scratch_.path("out/" + file)),
                      read_text(scratch_.path(std::string(plane) + ".npy")))
                << file;
          }
          motions.insert(read_text(scratch_.path("motion.npy")));
        }
        EXPECT_EQ(motions.size(), still ? 1u : 3u) << name << " " << camera;
      }
    }
  }
}

}  // namespace
}  // namespace octrace::test
