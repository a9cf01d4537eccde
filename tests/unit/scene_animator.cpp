// Animations of small files made here: which one is played, what it moves, and that going from
// moment to moment ends where a fresh load at that moment does.
#include "backend/scene/animator.h"

#include <cstring>

#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::expect_valid;
using testing::GltfFile;
using testing::json;

const std::vector<float> kTriangle{0, 0, 0, 1, 0, 0, 0, 1, 0};

int add_animation(GltfFile& file, const std::string& name, int node, const std::string& path,
                  const char* type, const std::vector<float>& times,
                  const std::vector<float>& values, const std::string& interpolation = "LINEAR") {
  const int input = file.floats("SCALAR", times), output = file.floats(type, values);
  return file.append(
      "animations",
      {{"name", name},
       {"samplers",
        json::array({{{"input", input}, {"output", output}, {"interpolation", interpolation}}})},
       {"channels",
        json::array({{{"sampler", 0}, {"target", {{"node", node}, {"path", path}}}}})}});
}

// Two triangles, a camera and a light on nodes of their own; an animation that moves node 0 and one
// that mirrors node 1.
GltfFile moving_file() {
  GltfFile file;
  const int mesh = file.mesh(kTriangle);
  file.root["extensionsUsed"] = {"KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = json::array({{{"type", "point"}}});
  file.append("cameras",
              {{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}});
  file.append("nodes", {{"mesh", mesh}, {"children", {2, 3}}, {"name", "mover"}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {5, 0, 0}}});
  file.append("nodes", {{"camera", 0}, {"name", "eye"}});
  file.append("nodes", {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  file.append("scenes", {{"nodes", {0, 1}}});
  add_animation(file, "slide", 0, "translation", "VEC3", {0.0f, 2.0f}, {0, 0, 0, 4, 0, 0});
  add_animation(file, "mirror", 1, "scale", "VEC3", {0.0f, 1.0f}, {1, 1, 1, -1, 1, 1}, "STEP");
  return file;
}

std::unique_ptr<Animator> open(const GltfFile& file, const std::string& animation, Time time,
                               Scene& scene) {
  auto animator = Animator::open(file.document(), {}, animation, time, scene);
  if (!animator) {
    ADD_FAILURE() << animator.error().to_string();
    return nullptr;
  }
  return std::move(*animator);
}

template <class T>
void expect_same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_TRUE(a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void expect_same(const Scene& a, const Scene& b) {
  expect_same_bits(a.positions, b.positions);
  expect_same_bits(a.normals, b.normals);
  expect_same_bits(a.tangents, b.tangents);
  expect_same_bits(a.uvs, b.uvs);
  expect_same_bits(a.colors, b.colors);
  expect_same_bits(a.triangles, b.triangles);
  expect_same_bits(a.lights, b.lights);
  EXPECT_EQ(a.bounds.lower, b.bounds.lower);
  EXPECT_EQ(a.bounds.upper, b.bounds.upper);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].matrix, b.cameras[i].matrix);
  }
}

TEST(Animator, PlaysTheFirstAnimationUnlessToldOtherwise) {
  const GltfFile file = moving_file();
  Scene scene;
  ASSERT_TRUE(open(file, "", 1.0, scene));
  EXPECT_EQ(scene.positions[0].x, 2.0f);
  EXPECT_EQ(scene.positions[3].x, 5.0f);
  ASSERT_TRUE(open(file, "slide", 0.5, scene));
  EXPECT_EQ(scene.positions[0].x, 1.0f);
  ASSERT_TRUE(open(file, "1", 1.0, scene));
  EXPECT_EQ(scene.positions[0].x, 0.0f);
  EXPECT_EQ(scene.positions[4].x, 4.0f);  // mirrored: to the left of its origin
  ASSERT_TRUE(open(file, "none", 1.0, scene));
  EXPECT_EQ(scene.positions[0].x, 0.0f);
  ASSERT_TRUE(open(file, "", std::nullopt, scene));
  EXPECT_EQ(scene.positions[0].x, 0.0f);
}

TEST(Animator, NamesWhatThereIsWhereAnAnimationIsMissing) {
  const GltfFile file = moving_file();
  for (const char* choice : {"jump", "2", "-1", "0x0", "1 "}) {
    Scene scene;
    const auto animator = Animator::open(file.document(), {}, choice, 0.0, scene);
    ASSERT_FALSE(animator) << choice;
    EXPECT_EQ(animator.error().exit, util::Exit::usage);
    EXPECT_NE(animator.error().message.find("0 \"slide\", 1 \"mirror\""), std::string::npos)
        << animator.error().message;
  }
}

TEST(Animator, AFileWithoutAnimationStaysAtRest) {
  GltfFile file;
  file.append("nodes", {{"mesh", file.mesh(kTriangle)}});
  file.append("scenes", {{"nodes", {0}}});
  Scene scene;
  const auto animator = open(file, "", 3.0, scene);
  ASSERT_TRUE(animator);
  EXPECT_FALSE(animator->moves());
  const auto changes = animator->move_to(5.0, scene);
  ASSERT_TRUE(changes);
  EXPECT_FALSE(changes->any());
}

TEST(Animator, MovesWhatHangsFromAMovedNodeAndNothingElse) {
  const GltfFile file = moving_file();
  Scene scene;
  const auto animator = open(file, "slide", 0.0, scene);
  const auto changes = animator->move_to(2.0, scene);
  ASSERT_TRUE(changes);
  EXPECT_TRUE(changes->positions && changes->cameras && changes->lights);
  EXPECT_FALSE(changes->normals || changes->triangles || changes->uvs);
  EXPECT_EQ(scene.cameras[0].matrix[3].x, 4.0);
  EXPECT_EQ(scene.lights[0].position.x, 4.0f);
  EXPECT_EQ(scene.bounds.lower.x, 4.0f);
  const auto again = animator->move_to(2.5, scene);  // after the last key
  ASSERT_TRUE(again);
  EXPECT_FALSE(again->any());
}

TEST(Animator, TurnsTrianglesOverWhereANodeComesToMirror) {
  const GltfFile file = moving_file();
  Scene scene;
  const auto animator = open(file, "mirror", 0.0, scene);
  const kernels::Triangle before = scene.triangles[1];
  const auto changes = animator->move_to(1.0, scene);
  ASSERT_TRUE(changes);
  EXPECT_TRUE(changes->triangles);
  EXPECT_EQ(scene.triangles[1].b, before.c);
  expect_valid(scene);
  ASSERT_TRUE(animator->move_to(0.5, scene));
  EXPECT_EQ(scene.triangles[1].b, before.b);
}

TEST(Animator, AnyOrderOfMomentsEndsWhereAFreshLoadDoes) {
  const GltfFile file = moving_file();
  for (const char* animation : {"slide", "mirror"}) {
    Scene scene;
    const auto animator = open(file, animation, std::nullopt, scene);
    for (const Time time : {Time(0.0), Time(1.7), Time(0.3), Time(), Time(1.0), Time(9.0)}) {
      ASSERT_TRUE(animator->move_to(time, scene));
      Scene fresh;
      ASSERT_TRUE(open(file, animation, time, fresh));
      expect_same(scene, fresh);
    }
  }
}

TEST(Animator, SeesAnotherMomentWithoutMoving) {
  const GltfFile file = moving_file();
  Scene scene;
  const auto animator = open(file, "slide", 0.0, scene);
  const Scene before = scene;
  const auto moment = animator->at(2.0, scene);
  ASSERT_TRUE(moment);
  expect_same(scene, before);
  Scene later;
  ASSERT_TRUE(open(file, "slide", 2.0, later));
  expect_same_bits(moment->positions, later.positions);
  EXPECT_EQ(camera_at(scene.cameras[0], scene, *moment).matrix, later.cameras[0].matrix);
  Camera other = scene.cameras[0];
  other.name = "elsewhere";
  EXPECT_EQ(camera_at(other, scene, *moment).matrix, other.matrix);
  const auto same = animator->at(-1.0, scene);
  ASSERT_TRUE(same);
  EXPECT_TRUE(same->positions.empty());
}

// A moment that throws a vertex out of range fails alone.
TEST(Animator, RecoversFromAMomentThatFails) {
  GltfFile file = moving_file();
  add_animation(file, "far", 0, "translation", "VEC3", {0.0f, 1.0f, 2.0f},
                {0, 0, 0, 3e9f, 0, 0, 1, 0, 0}, "STEP");
  add_animation(file, "far scale", 1, "scale", "VEC3", {0.0f, 1.0f, 2.0f},
                {1, 1, 1, -3e9f, 1, 1, 1, 1, 1}, "STEP");
  for (const char* animation : {"far", "far scale"}) {
    Scene scene;
    const auto animator = open(file, animation, 0.0, scene);
    const auto failed = animator->move_to(1.0, scene);
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().exit, util::Exit::unsupported);
    ASSERT_TRUE(animator->move_to(2.0, scene));
    Scene fresh;
    ASSERT_TRUE(open(file, animation, 2.0, fresh));
    expect_same(scene, fresh);
  }
}

TEST(Animator, NormalisedIntegersAreRotationsAndWeights) {
  GltfFile file;
  const std::vector<float> moved{0, 0, 2, 0, 0, 2, 0, 0, 2};
  const int mesh = file.mesh(kTriangle);
  file.root["meshes"][mesh]["primitives"][0]["targets"] =
      json::array({{{"POSITION", file.floats("VEC3", moved)}}});
  file.append("nodes", {{"mesh", mesh}});
  file.append("scenes", {{"nodes", {0}}});
  const int times = file.floats("SCALAR", {0.0f, 1.0f});
  const int weights = file.uint16s("SCALAR", {0, 65535});
  const int rotations = file.uint16s("VEC4", {0, 0, 0, 32767, 0, 0, 23170, 23170});
  file.root["accessors"][weights]["normalized"] = true;
  file.root["accessors"][rotations]["normalized"] = true;
  file.root["accessors"][rotations]["componentType"] = 5122;
  file.append("animations",
              {{"samplers", json::array({{{"input", times}, {"output", weights}},
                                         {{"input", times}, {"output", rotations}}})},
               {"channels",
                json::array({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}},
                             {{"sampler", 1}, {"target", {{"node", 0}, {"path", "rotation"}}}}})}});
  Scene scene;
  ASSERT_TRUE(open(file, "", 0.5, scene));
  const double half = std::sqrt(0.5);  // an eighth of a turn about z
  EXPECT_NEAR(scene.positions[1].x, half, 1e-6);
  EXPECT_NEAR(scene.positions[1].y, half, 1e-6);
  EXPECT_NEAR(scene.positions[1].z, 1.0, 1e-6);
}

}  // namespace
}  // namespace octrace::scene
