#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <random>

#include "backend/scene/pose.h"
#include "backend/scene/triangulate.h"
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

const std::vector<float> kTriangle = {0, 0, 0, 1, 0, 0, 0, 1, 0};

using Corners = std::vector<std::array<std::uint32_t, 3>>;

Corners corners(const std::vector<kernels::Triangle>& triangles) {
  Corners list;
  for (const auto& t : triangles) list.push_back({t.a, t.b, t.c});
  return list;
}

TEST(SceneTriangulate, ListsStripsAndFansByHand) {
  const std::vector<std::uint32_t> i = {9, 8, 7, 6, 5};
  EXPECT_EQ(corners(triangulate(4, i, 10)), (Corners{{9, 8, 7}}));  // two indices are left over
  EXPECT_EQ(corners(triangulate(5, i, 10)), (Corners{{9, 8, 7}, {8, 6, 7}, {7, 6, 5}}));
  EXPECT_EQ(corners(triangulate(6, i, 10)), (Corners{{8, 7, 9}, {7, 6, 9}, {6, 5, 9}}));
  EXPECT_EQ(corners(triangulate(4, {}, 6)), (Corners{{0, 1, 2}, {3, 4, 5}}));
  EXPECT_EQ(corners(triangulate(5, {}, 4)), (Corners{{0, 1, 2}, {1, 3, 2}}));
  EXPECT_EQ(corners(triangulate(6, {}, 4)), (Corners{{1, 2, 0}, {2, 3, 0}}));
  for (const int mode : {0, 1, 2, 3}) EXPECT_TRUE(triangulate(mode, i, 10).empty());
  for (const int mode : {4, 5, 6}) {
    for (std::uint32_t n = 0; n < 12; ++n) {
      EXPECT_EQ(triangulate(mode, {}, n).size(), triangle_count(mode, n));
    }
    EXPECT_EQ(triangle_count(mode, 2), 0u);
  }
}

TEST(SceneFlatten, HierarchiesOfTransformsAndMatrices) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 30; ++round) {
    GltfFile file;
    const int mesh = file.mesh(kTriangle);
    dmat4 expected(1.0);
    const int depth = 6;
    for (int level = 0; level < depth; ++level) {
      const dvec3 t(normal(random), normal(random), normal(random));
      const glm::dquat q = glm::normalize(
          glm::dquat(normal(random), normal(random), normal(random), normal(random)));
      const dvec3 s(normal(random), normal(random), normal(random));
      const dmat4 local =
          glm::translate(dmat4(1.0), t) * glm::mat4_cast(q) * glm::scale(dmat4(1.0), s);
      json node;
      if (level % 2 == 0) {
        node = {{"translation", {t.x, t.y, t.z}},
                {"rotation", {q.x, q.y, q.z, q.w}},
                {"scale", {s.x, s.y, s.z}}};
      } else {
        node["matrix"] = json::array();
        for (int i = 0; i < 16; ++i) node["matrix"].push_back(local[i / 4][i % 4]);
      }
      if (level + 1 < depth) node["children"] = {level + 1};
      if (level + 1 == depth) node["mesh"] = mesh;
      file.append("nodes", node);
      expected = expected * local;
    }
    file.append("scenes", {{"nodes", {0}}});
    const Scene scene = file.scene();
    expect_valid(scene);
    ASSERT_EQ(scene.triangles.size(), 1u);
    EXPECT_EQ(scene.geometries[0].object, static_cast<std::uint32_t>(depth - 1));
    const bool mirrored = glm::determinant(glm::dmat3(expected)) < 0.0;
    const auto& triangle = scene.triangles[0];
    const std::uint32_t order[3] = {triangle.a, mirrored ? triangle.c : triangle.b,
                                    mirrored ? triangle.b : triangle.c};
    for (std::uint32_t c = 0; c < 3; ++c) {
      EXPECT_EQ(order[c], c);
      const dvec3 p = dvec3(
          expected * dvec4(kTriangle[3 * c], kTriangle[3 * c + 1], kTriangle[3 * c + 2], 1.0));
      EXPECT_LT(glm::length(position(scene, order[c]) - p), 1e-6 * (1.0 + glm::length(p)));
    }
  }
}

TEST(SceneFlatten, NormalsAndTangentsUnderMirrorsAndUnevenScale) {
  GltfFile file;
  const int normals = file.floats("VEC3", {0, 0, 1, 0, 0, 1, 0, 0.6f, 0.8f});
  const int tangents = file.floats("VEC4", {1, 0, 0, 1, 1, 0, 0, -1, 1, 0, 0, 1});
  const int mesh =
      file.mesh(kTriangle, 4, {{"attributes", {{"NORMAL", normals}, {"TANGENT", tangents}}}});
  file.append("nodes", {{"mesh", mesh}, {"scale", {2, 4, -5}}});
  file.append("nodes", {{"mesh", mesh}, {"scale", {2, 4, 5}}});
  file.append("nodes", {{"mesh", mesh}, {"scale", {1, 1, 0}}});
  file.append("nodes", {{"mesh", mesh}, {"scale", {0, 0, 0}}});
  file.append("scenes", {{"nodes", {0, 1, 2, 3}}});
  const Scene scene = file.scene();
  expect_valid(scene);
  ASSERT_EQ(scene.geometries.size(), 4u);
  // The mirror turns the flat normal over; the stated normal goes by the inverse transpose.
  EXPECT_EQ(scene.normals[0], kernels::Vec3(0, 0, -1));
  EXPECT_EQ(scene.normals[3], kernels::Vec3(0, 0, 1));
  const dvec3 slanted = glm::normalize(dvec3(0, 0.6 / 4, 0.8 / 5));
  EXPECT_NEAR(scene.normals[5].y, slanted.y, 1e-6);
  EXPECT_NEAR(scene.normals[5].z, slanted.z, 1e-6);
  EXPECT_NEAR(scene.normals[2].z, -slanted.z, 1e-6);
  EXPECT_EQ(scene.tangents[0], kernels::Vec4(1, 0, 0, -1));
  EXPECT_EQ(scene.tangents[1], kernels::Vec4(1, 0, 0, 1));
  EXPECT_EQ(scene.tangents[3], kernels::Vec4(1, 0, 0, 1));
  // A flattened node keeps the normal of the plane that it is flattened to.
  EXPECT_EQ(scene.normals[8], kernels::Vec3(0, 0, 1));
  for (int instance = 0; instance < 2; ++instance) {
    const auto& t = scene.triangles[instance];
    const dvec3 flat = glm::cross(position(scene, t.b) - position(scene, t.a),
                                  position(scene, t.c) - position(scene, t.a));
    EXPECT_GT(glm::dot(flat, dvec3(scene.normals[3 * instance])), 0.0);
  }
}

TEST(SceneFlatten, InstancesScenesAndNames) {
  GltfFile file;
  const int mesh = file.mesh(kTriangle);
  file.append("nodes", {{"name", "first"}, {"mesh", mesh}, {"children", {2}}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {0, 0, 5}}});
  file.append("nodes", {{"mesh", mesh}, {"translation", {0, 7, 0}}});
  file.append("scenes", {{"name", "left"}, {"nodes", {1, 0}}});
  file.append("scenes", {{"nodes", {1}}});
  const Scene all = file.scene();
  expect_valid(all);
  ASSERT_EQ(all.geometries.size(), 3u);
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ(all.geometries[i].object, i);
  EXPECT_EQ(all.object_names, (std::vector<std::string>{"first", "node 1", "node 2"}));
  EXPECT_EQ(all.positions[6].y, 7.0f);
  EXPECT_EQ(all.material_names, std::vector<std::string>{"default"});

  FlattenOptions options;
  options.scene = 1;
  const Scene one = file.scene(options);
  ASSERT_EQ(one.geometries.size(), 1u);
  EXPECT_EQ(one.geometries[0].object, 1u);
  EXPECT_EQ(one.positions[0].z, 5.0f);

  for (const int missing : {2, -1}) {
    options.scene = missing;
    const auto none = flatten(file.document(), options);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().exit, util::Exit::usage);
    EXPECT_NE(none.error().message.find("\"left\""), std::string::npos) << none.error().message;
  }
  file.root.erase("scenes");
  file.root.erase("scene");
  EXPECT_EQ(file.scene().geometries.size(), 3u) << "no scene: every root node";
}

TEST(SceneFlatten, PointsAndLinesAreOneWarning) {
  GltfFile file;
  const int points = file.mesh(kTriangle, 0), lines = file.mesh(kTriangle, 3);
  file.root["meshes"][lines]["name"] = "wire";
  const int mesh = file.mesh(kTriangle);
  for (const int m : {points, lines, points, mesh}) file.append("nodes", {{"mesh", m}});
  file.append("scenes", {{"nodes", {0, 1, 2, 3}}});
  const Scene scene = file.scene();
  EXPECT_EQ(scene.triangles.size(), 1u);
  ASSERT_EQ(scene.warnings.size(), 1u);
  EXPECT_NE(scene.warnings[0].find("2 primitives"), std::string::npos) << scene.warnings[0];
  EXPECT_NE(scene.warnings[0].find("mesh 0, wire"), std::string::npos) << scene.warnings[0];
}

TEST(SceneFlatten, StripsAndFansOfIndices) {
  for (const int mode : {5, 6}) {
    GltfFile file;
    const int indices = file.uint16s("SCALAR", {3, 2, 1, 0});
    const int mesh = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, mode, {{"indices", indices}});
    file.append("nodes", {{"mesh", mesh}});
    file.append("nodes", {{"mesh", mesh}, {"scale", {-1, 1, 1}}});
    file.append("scenes", {{"nodes", {0, 1}}});
    const Scene scene = file.scene();
    expect_valid(scene);
    const Corners expected = mode == 5 ? Corners{{3, 2, 1}, {2, 0, 1}, {7, 5, 6}, {6, 5, 4}}
                                       : Corners{{2, 1, 3}, {1, 0, 3}, {6, 7, 5}, {5, 7, 4}};
    EXPECT_EQ(corners(scene.triangles), expected);
  }
}

TEST(SceneFlatten, SparsePositionsAndAttributes) {
  GltfFile file;
  const int indices = file.uint16s("SCALAR", {1});
  const int values = file.floats("VEC3", {5, 6, 7});
  const int uv = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
  const int uv1 = file.floats("VEC2", {9, 9, 8, 8, 7, 7});
  const int color = file.floats("VEC3", {1, 0, 0, 0, 1, 0, 0, 0, 0.5f});
  const int mesh =
      file.mesh(kTriangle, 4,
                {{"attributes", {{"TEXCOORD_0", uv}, {"TEXCOORD_1", uv1}, {"COLOR_0", color}}}});
  const int base = file.root["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"];
  file.root["accessors"][base]["sparse"] = {
      {"count", 1},
      {"indices",
       {{"bufferView", file.root["accessors"][indices]["bufferView"]}, {"componentType", 5123}}},
      {"values", {{"bufferView", file.root["accessors"][values]["bufferView"]}}}};
  file.root["accessors"][base]["min"] = {0, 0, 0};
  file.root["accessors"][base]["max"] = {5, 6, 7};
  file.append("nodes", {{"mesh", mesh}});
  file.append("scenes", {{"nodes", {0}}});
  const Scene scene = file.scene();
  expect_valid(scene);
  EXPECT_EQ(scene.positions[1], kernels::Vec3(5, 6, 7));
  EXPECT_EQ(scene.positions[2], kernels::Vec3(0, 1, 0));
  const auto& geometry = scene.geometries[0];
  EXPECT_EQ(scene.uvs[geometry.uv0 + 1], kernels::Vec2(1, 0));
  EXPECT_EQ(scene.uvs[geometry.uv1 + 2], kernels::Vec2(7, 7));
  EXPECT_EQ(scene.colors[geometry.colors + 2], kernels::Vec4(0, 0, 0.5f, 1.0f));
  EXPECT_EQ(geometry.normals, kernels::kNone);
  EXPECT_EQ(geometry.tangents, kernels::kNone);
}

TEST(SceneFlatten, DeepHierarchiesTakeNoStack) {
  GltfFile file;
  const int mesh = file.mesh(kTriangle);
  const int depth = 100'000;
  json nodes = json::array();
  for (int i = 0; i < depth; ++i) {
    json node = {{"translation", {0.25, 0, 0}}};
    if (i + 1 < depth) {
      node["children"] = {i + 1};
    } else {
      node["mesh"] = mesh;
    }
    nodes.push_back(std::move(node));
  }
  file.root["nodes"] = std::move(nodes);
  file.append("scenes", {{"nodes", {0}}});
  const Scene scene = file.scene();
  ASSERT_EQ(scene.positions.size(), 3u);
  EXPECT_EQ(scene.positions[0].x, 25'000.0f);
}

TEST(SceneFlatten, PositionsOutOfRangeAreErrorsThatNameTheirNode) {
  // Once beyond the range of coordinates, once beyond that of double.
  for (const int levels : {1, 12}) {
    GltfFile file;
    const int mesh = file.mesh(kTriangle);
    file.append("nodes", {{"mesh", mesh}});
    for (int level = 1; level <= levels; ++level) {
      const double scale = levels == 1 ? 2e9 : 1e30;
      json node = {{"scale", {scale, scale, scale}}};
      if (level == levels) {
        node["mesh"] = mesh;
      } else {
        node["children"] = {level + 1};
      }
      file.append("nodes", node);
    }
    file.append("scenes", {{"nodes", {0, 1}}});
    const auto scene = flatten(file.document(), {});
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().exit, util::Exit::unsupported);
    EXPECT_EQ(scene.error().pointer, "/nodes/" + std::to_string(levels));
    EXPECT_NE(scene.error().message.find("mesh 0"), std::string::npos);
  }
}

TEST(SceneFlatten, LimitsNameTheirOption) {
  GltfFile file;
  const int mesh = file.mesh(kTriangle);
  for (int i = 0; i < 10; ++i) file.append("nodes", {{"mesh", mesh}});
  file.append("scenes", {{"nodes", {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}}});
  const gltf::Document document = file.document();
  const auto fails = [&](const util::Limits& limits, const char* option) {
    FlattenOptions options;
    options.limits = limits;
    const auto scene = flatten(document, options);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().exit, util::Exit::limit);
    EXPECT_NE(scene.error().message.find(option), std::string::npos) << scene.error().message;
  };
  util::Limits limits;
  limits.max_triangles = 9;
  fails(limits, "--max-triangles");
  limits = {};
  limits.max_nodes = 9;
  fails(limits, "--max-nodes");
  limits = {};
  limits.max_scene_bytes = 1000;
  fails(limits, "--max-scene-bytes");
  limits = {};
  limits.max_triangles = 10;
  limits.max_nodes = 10;
  FlattenOptions options;
  options.limits = limits;
  EXPECT_TRUE(flatten(document, options));
}

TEST(SceneFlatten, CountsWithoutDataAreLimitedBeforeTheyAreRead) {
  // An accessor without a buffer view is all zeros: 24 MB of positions in 300 bytes of file.
  GltfFile file;
  const int accessor = file.append("accessors", {{"componentType", 5126},
                                                 {"type", "VEC3"},
                                                 {"count", 2'000'000},
                                                 {"min", {0, 0, 0}},
                                                 {"max", {0, 0, 0}}});
  file.append("meshes",
              {{"primitives", json::array({{{"attributes", {{"POSITION", accessor}}}}})}});
  file.append("nodes", {{"mesh", 0}});
  file.append("scenes", {{"nodes", {0}}});
  FlattenOptions options;
  options.limits.max_scene_bytes = 20 << 20;
  const auto scene = flatten(file.document(), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().exit, util::Exit::limit);
  EXPECT_NE(scene.error().message.find("--max-scene-bytes"), std::string::npos);
}

TEST(SceneFlatten, CamerasStandAtTheirNodes) {
  GltfFile file;
  file.append("cameras", {{"type", "perspective"},
                          {"name", "lens"},
                          {"perspective", {{"yfov", 0.5}, {"znear", 0.1}, {"aspectRatio", 3}}}});
  file.append("cameras", {{"type", "orthographic"},
                          {"orthographic", {{"xmag", 2}, {"ymag", 3}, {"znear", 0}, {"zfar", 9}}}});
  file.append("nodes", {{"camera", 1}, {"translation", {1, 2, 3}}, {"name", "top"}});
  file.append("nodes", {{"camera", 0}, {"children", {2}}});
  file.append("nodes", {{"camera", 1}, {"rotation", {0, 1, 0, 0}}});
  file.append("scenes", {{"nodes", {1, 0}}});
  const Scene scene = file.scene();
  ASSERT_EQ(scene.cameras.size(), 3u);
  EXPECT_EQ(scene.cameras[0].name, "top");
  EXPECT_EQ(scene.cameras[1].name, "lens");
  EXPECT_EQ(scene.cameras[2].name, "camera 1");
  EXPECT_EQ(scene.cameras[0].type, CameraType::orthographic);
  EXPECT_EQ(scene.cameras[0].ymag, 3.0);
  EXPECT_EQ(scene.cameras[0].zfar, 9.0);
  EXPECT_EQ(scene.cameras[0].matrix[3], dvec4(1, 2, 3, 1));
  EXPECT_EQ(scene.cameras[1].yfov, 0.5);
  EXPECT_TRUE(std::isinf(scene.cameras[1].zfar)) << "absent means infinite";
  EXPECT_EQ(make_ray_camera(scene.cameras[2], 4, 4).axis, kernels::Vec3(0, 0, 1));
  EXPECT_TRUE(scene.bounds.empty);
}

TEST(SceneFlatten, LightsFollowTheExtension) {
  GltfFile file;
  file.root["extensionsUsed"] = {"KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] =
      json::array({{{"type", "directional"}, {"color", {1, 0.5, 0.25}}, {"intensity", 4}},
                   {{"type", "point"}, {"intensity", 10}, {"range", 6}},
                   {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.6}}}},
                   {{"type", "spot"}, {"spot", json::object({{"innerConeAngle", 0.0}})}}});
  for (int i = 0; i < 4; ++i) {
    json node = {{"translation", {i, 0, 0}}, {"scale", {3, 3, 3}}};
    node["extensions"]["KHR_lights_punctual"]["light"] = i;
    node["rotation"] = {std::sqrt(0.5), 0, 0, -std::sqrt(0.5)};  // a quarter turn: -Z becomes -Y
    file.append("nodes", node);
  }
  file.append("scenes", {{"nodes", {0, 1, 2, 3}}});
  const Scene scene = file.scene();
  ASSERT_EQ(scene.lights.size(), 4u);
  const auto& sun = scene.lights[0];
  EXPECT_EQ(sun.type, kernels::LightType::directional);
  EXPECT_NEAR(sun.direction.y, -1.0f, 1e-6f);
  EXPECT_EQ(sun.intensity, kernels::Vec3(4, 2, 1));
  EXPECT_EQ(scene.lights[1].position, kernels::Vec3(1, 0, 0));
  EXPECT_EQ(scene.lights[1].range, 6.0f);
  EXPECT_TRUE(std::isinf(scene.lights[2].range));
  const auto attenuation = [](const kernels::Light& light, double angle) {
    return std::clamp(std::cos(angle) * light.spot_scale + light.spot_offset, 0.0, 1.0);
  };
  EXPECT_NEAR(attenuation(scene.lights[2], 0.2), 1.0, 1e-5);
  EXPECT_NEAR(attenuation(scene.lights[2], 0.6), 0.0, 1e-5);
  EXPECT_NEAR(attenuation(scene.lights[2], 0.4),
              (std::cos(0.4) - std::cos(0.6)) / (std::cos(0.2) - std::cos(0.6)), 1e-5);
  EXPECT_NEAR(attenuation(scene.lights[3], M_PI / 4.0), 0.0, 1e-5);
  EXPECT_NEAR(attenuation(scene.lights[3], 0.0), 1.0, 1e-5);
}

TEST(SceneFlatten, PosesOtherThanTheStaticOne) {
  GltfFile file;
  const int mesh = file.mesh(kTriangle);
  file.append("nodes", {{"mesh", mesh}});
  file.append("scenes", {{"nodes", {0}}});
  const gltf::Document document = file.document();
  Pose pose = static_pose(document.model);
  pose.nodes[0].translation = {0.0, 0.0, 4.0};
  const auto moved = flatten(document, pose, {});
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->positions[1], kernels::Vec3(1, 0, 4));
}

}  // namespace
}  // namespace octrace::scene
