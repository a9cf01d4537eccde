#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "backend/scene/deform.h"
#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using glm::dmat4;
using glm::dvec3;
using glm::dvec4;
using testing::expect_valid;
using testing::GltfFile;
using testing::json;
using testing::position;

// A random strip of triangles with normals, bound to `joints` joints by `sets` sets of weights.
struct SkinnedFile {
  GltfFile file;
  std::vector<dvec3> positions, normals;
  std::vector<std::vector<double>> weights;  // by vertex, by joint
  std::vector<dmat4> worlds, inverse_binds;

  SkinnedFile(int vertices, int joints, int sets, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<float> p, n;
    for (int i = 0; i < vertices; ++i) {
      dvec3 direction(normal(random), normal(random), normal(random));
      direction = glm::normalize(direction);
      for (int c = 0; c < 3; ++c) {
        p.push_back(normal(random));
        n.push_back(static_cast<float>(direction[c]));
      }
      positions.emplace_back(p[3 * i], p[3 * i + 1], p[3 * i + 2]);
      normals.emplace_back(n[3 * i], n[3 * i + 1], n[3 * i + 2]);
    }
    json attributes = {{"NORMAL", file.floats("VEC3", n)}};
    weights.assign(vertices, std::vector<double>(joints, 0.0));
    std::vector<std::vector<float>> values(sets);
    std::vector<std::vector<std::uint16_t>> indices(sets);
    for (int v = 0; v < vertices; ++v) {
      std::vector<float> raw(4 * sets);
      float total = 0.0f;
      for (float& w : raw) total += w = std::abs(normal(random));
      for (int k = 0; k < 4 * sets; ++k) {
        const auto joint = static_cast<std::uint16_t>((v + k) % joints);
        const float weight = raw[k] / total;
        indices[k / 4].push_back(joint);
        values[k / 4].push_back(weight);
        weights[v][joint] += weight;
      }
    }
    for (int s = 0; s < sets; ++s) {
      attributes["JOINTS_" + std::to_string(s)] = file.uint16s("VEC4", indices[s]);
      attributes["WEIGHTS_" + std::to_string(s)] = file.floats("VEC4", values[s]);
    }
    const int mesh = file.mesh(p, 5, {{"attributes", attributes}});

    // Joints in a chain; node 0 carries the mesh far away, which must not matter.
    std::vector<float> binds;
    dmat4 world(1.0);
    json joint_nodes = json::array();
    file.append("nodes", {{"mesh", mesh}, {"skin", 0}, {"translation", {100, 200, 300}}});
    for (int j = 0; j < joints; ++j) {
      const dvec3 t(normal(random), normal(random), normal(random));
      const glm::dquat q = glm::normalize(
          glm::dquat(normal(random), normal(random), normal(random), normal(random)));
      world = world * glm::translate(dmat4(1.0), t) * glm::mat4_cast(q);
      worlds.push_back(world);
      json node = {{"translation", {t.x, t.y, t.z}}, {"rotation", {q.x, q.y, q.z, q.w}}};
      if (j + 1 < joints) node["children"] = {j + 2};
      joint_nodes.push_back(file.append("nodes", node));
      dmat4 bind = glm::translate(dmat4(1.0), dvec3(normal(random), 0.5 * j, normal(random)));
      bind = glm::rotate(bind, 0.3 * j, dvec3(0, 1, 0));
      for (int i = 0; i < 16; ++i) {
        const auto element = static_cast<float>(bind[i / 4][i % 4]);
        binds.push_back(element);
        bind[i / 4][i % 4] = element;
      }
      inverse_binds.push_back(bind);
    }
    file.append("skins",
                {{"joints", joint_nodes}, {"inverseBindMatrices", file.floats("MAT4", binds)}});
    file.append("scenes", {{"nodes", {0, 1}}});
  }
};

TEST(SceneDeform, SkinsAgreeWithTheFormula) {
  for (const int sets : {1, 2, 3}) {
    SkinnedFile skinned(50, 5, sets, 7 + sets);
    const Scene scene = skinned.file.scene();
    expect_valid(scene);
    ASSERT_EQ(scene.positions.size(), 50u);
    for (std::uint32_t v = 0; v < 50; ++v) {
      // Vertex by vertex and joint by joint, as the specification's formula sums them.
      dvec3 p(0.0);
      dmat4 blended(0.0);
      double total = 0.0;
      for (std::size_t j = 0; j < 5; ++j) total += skinned.weights[v][j];
      for (std::size_t j = 0; j < 5; ++j) {
        const double w = skinned.weights[v][j] / total;
        const dvec4 bound = skinned.inverse_binds[j] * dvec4(skinned.positions[v], 1.0);
        p += w * dvec3(skinned.worlds[j] * bound);
        blended += w * (skinned.worlds[j] * skinned.inverse_binds[j]);
      }
      EXPECT_LT(glm::length(position(scene, v) - p), 2e-6) << v;
      const dvec3 n =
          glm::normalize(glm::transpose(glm::inverse(glm::dmat3(blended))) * skinned.normals[v]);
      const double agreement = glm::dot(dvec3(scene.normals[v]), n);
      EXPECT_NEAR(agreement, 1.0, 1e-5) << v;
    }
  }
}

TEST(SceneDeform, WeightsAreBroughtToASumOfOne) {
  SkinBinding binding;
  binding.joints = {{0, 1, 0, 0, 1, 0, 0, 0}, {2, 0, 0, 0, 0, 0, 0, 0}};
  binding.weights = {{0.5f, 1.0f, 0, 0, 0, 0, 0, 0}, {0.5f, 0, 0, 0, 0, 0, 0, 0}};
  std::vector<dmat4> joints;
  for (const dvec3& t : {dvec3(8, 0, 0), dvec3(0, 8, 0), dvec3(0, 0, 8)}) {
    joints.push_back(glm::translate(dmat4(1.0), t));
  }
  EXPECT_EQ(blend_joints(binding, joints, 0)[3], dvec4(2, 4, 2, 1));
  EXPECT_EQ(blend_joints(binding, joints, 1), joints[1]) << "without weights: its first joint";
}

TEST(SceneDeform, MirroredSkeletonsSwapTheWinding) {
  GltfFile file;
  const int joints = file.uint16s("VEC4", std::vector<std::uint16_t>(12, 0));
  const int weights = file.floats("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int mesh = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
                             {{"attributes", {{"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 0}, {"scale", {-1, 1, 1}}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 1}});
  file.append("nodes", {{"translation", {0, 0, 1}}});
  file.append("nodes", {{"scale", {-1, 1, 1}}});
  file.append("skins", {{"joints", {2}}});
  file.append("skins", {{"joints", {3}}});
  file.append("scenes", {{"nodes", {0, 1, 2, 3}}});
  const Scene scene = file.scene();
  ASSERT_EQ(scene.triangles.size(), 2u);
  // The mesh node's own mirror is ignored, with the rest of its transform.
  EXPECT_EQ(scene.triangles[0].b, 1u);
  EXPECT_EQ(scene.positions[1], kernels::Vec3(1, 0, 1));
  EXPECT_EQ(scene.triangles[1].b, 5u);
  EXPECT_EQ(scene.triangles[1].c, 4u);
  EXPECT_EQ(scene.positions[4], kernels::Vec3(-1, 0, 0));
}

TEST(SceneDeform, MorphTargetsAddUpAndTheNodesWeightsWin) {
  GltfFile file;
  const int first = file.floats("VEC3", {0, 0, 1, 0, 0, 2, 0, 0, 3});
  const int second = file.floats("VEC3", {1, 0, 0, 1, 0, 0, 1, 0, 0});
  const int normals = file.floats("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  const int tilt = file.floats("VEC3", {1, 0, 0, 0, 1, 0, 0, 0, 0});
  const int uv = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
  const int slide = file.floats("VEC2", {0.5f, 0, 0.5f, 0, 0.5f, 0});
  const int color = file.floats("VEC4", {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
  const int glow = file.floats("VEC4", {1, 0, 0, 0, 4, 0, 0, 0, -4, 0, 0, 0});
  const int mesh = file.mesh(
      {0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
      {{"attributes", {{"NORMAL", normals}, {"TEXCOORD_0", uv}, {"COLOR_0", color}}},
       {"targets", json::array({{{"POSITION", first}, {"NORMAL", tilt}, {"TEXCOORD_0", slide}},
                                {{"POSITION", second}, {"COLOR_0", glow}}})}});
  file.root["meshes"][mesh]["weights"] = {0.5, 0.0};
  file.append("nodes", {{"mesh", mesh}});
  file.append("nodes", {{"mesh", mesh}, {"weights", {0.25, 2.0}}});
  file.append("nodes", {{"mesh", mesh}, {"weights", {0.0, 0.0}}});
  file.append("scenes", {{"nodes", {0, 1, 2}}});
  const Scene scene = file.scene();
  expect_valid(scene);
  EXPECT_EQ(scene.positions[1], kernels::Vec3(1, 0, 1));
  EXPECT_EQ(scene.positions[4], kernels::Vec3(3, 0, 0.5f));
  EXPECT_EQ(scene.positions[7], kernels::Vec3(1, 0, 0));
  const dvec3 tilted = glm::normalize(dvec3(0.5, 0, 1));
  EXPECT_NEAR(scene.normals[0].x, tilted.x, 1e-6);
  EXPECT_NEAR(scene.normals[0].z, tilted.z, 1e-6);
  EXPECT_EQ(scene.normals[8], kernels::Vec3(0, 0, 1));
  EXPECT_EQ(scene.uvs[scene.geometries[0].uv0 + 1], kernels::Vec2(1.25f, 0));
  EXPECT_EQ(scene.uvs[scene.geometries[2].uv0 + 1], kernels::Vec2(1, 0));
  const std::uint32_t colors = scene.geometries[1].colors;
  EXPECT_EQ(scene.colors[colors], kernels::Vec4(1, 0, 0, 1)) << "clamped after the sum";
  EXPECT_EQ(scene.colors[colors + 2], kernels::Vec4(0, 0, 0, 1));
}

TEST(SceneDeform, MorphsComeBeforeSkins) {
  GltfFile file;
  const int joints = file.uint16s("VEC4", std::vector<std::uint16_t>(12, 0));
  const int weights = file.floats("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int up = file.floats("VEC3", {0, 1, 0, 0, 1, 0, 0, 1, 0});
  const int mesh = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
                             {{"attributes", {{"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
                              {"targets", json::array({{{"POSITION", up}}})}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 0}, {"weights", {1}}});
  file.append("nodes", {{"scale", {2, 3, 4}}});
  file.append("skins", {{"joints", {1}}});
  file.append("scenes", {{"nodes", {0, 1}}});
  const Scene scene = file.scene();
  ASSERT_EQ(scene.positions.size(), 3u);
  EXPECT_EQ(scene.positions[1], kernels::Vec3(2, 3, 0));
}

TEST(SceneDeform, JointsOutsideOfTheSkinAreErrors) {
  GltfFile file;
  const int joints = file.uint16s("VEC4", {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0});
  const int weights = file.floats("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int mesh = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
                             {{"attributes", {{"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}});
  file.append("nodes", {{"mesh", mesh}, {"skin", 0}});
  file.append("nodes", json::object({{"name", "joint"}}));
  file.append("skins", {{"joints", {1}}});
  file.append("scenes", {{"nodes", {0, 1}}});
  const auto document = file.load();
  const util::Error error = document ? flatten(*document, {}).error() : document.error();
  EXPECT_EQ(error.exit, util::Exit::invalid_input);
  EXPECT_EQ(error.code, "ACCESSOR_JOINTS_INDEX_OOB") << error.to_string();
}

}  // namespace
}  // namespace octrace::scene
