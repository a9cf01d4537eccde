#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "backend/scene/builtin.h"
#include "backend/scene/exact_math.h"
#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::expect_valid;
using testing::position;

std::uint64_t fingerprint(const Scene& scene) {
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  const auto add = [&](const auto& values) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
    for (std::size_t i = 0; i < values.size() * sizeof(values[0]); ++i) {
      hash = (hash ^ bytes[i]) * 0x100000001b3ull;
    }
  };
  add(scene.positions);
  add(scene.triangles);
  add(scene.normals);
  add(scene.uvs);
  add(scene.texels);
  return hash;
}

// Closed once vertices of equal position are taken as one: every edge is passed once each way.
void expect_closed(const Scene& scene) {
  std::map<std::tuple<float, float, float>, int> points;
  const auto point = [&](std::uint32_t i) {
    const auto& p = scene.positions[i];
    return points.try_emplace({p.x, p.y, p.z}, static_cast<int>(points.size())).first->second;
  };
  std::map<std::pair<int, int>, int> edges;
  for (const auto& t : scene.triangles) {
    const int a = point(t.a), b = point(t.b), c = point(t.c);
    for (const auto& edge : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) ++edges[edge];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
}

TEST(SceneBuiltin, AllNamesMakeValidScenes) {
  for (const std::string& name : builtin_names()) {
    const auto scene = make_builtin(name);
    ASSERT_TRUE(scene) << name;
    SCOPED_TRACE(name);
    expect_valid(*scene);
    EXPECT_FALSE(scene->cameras.empty());
    EXPECT_FALSE(scene->lights.empty());
  }
}

TEST(SceneBuiltin, PaperHasItsCountsItsCamerasAndNoHoles) {
  const Scene scene = make_paper_scene();
  EXPECT_EQ(scene.positions.size(), 855u);
  EXPECT_EQ(scene.triangles.size(), 1692u);
  std::set<std::uint32_t> used;
  for (const auto& t : scene.triangles) used.insert({t.a, t.b, t.c});
  EXPECT_EQ(used.size(), 855u);
  expect_closed(scene);
  ASSERT_EQ(scene.cameras.size(), 4u);
  const double distances[] = {700, 600, 500, 400};
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(scene.cameras[i].name, fmt::format("Z{:g}", distances[i]));
    EXPECT_EQ(scene.cameras[i].matrix[3], glm::dvec4(0, 0, distances[i], 1));
    EXPECT_EQ(make_ray_camera(scene.cameras[i], 800, 600).axis, kernels::Vec3(0, 0, -1));
    // The model fills a part of each image and leaves none.
    const double half = std::tan(0.5 * scene.cameras[i].yfov);
    for (const auto& p : scene.positions) {
      const double depth = distances[i] - p.z;
      ASSERT_LT(std::abs(p.y) / depth, half);
      ASSERT_LT(std::abs(p.x) / depth, half * 4.0 / 3.0);
    }
  }
}

TEST(SceneBuiltin, PaperFacesOutwards) {
  // Six times the enclosed volume, by the divergence theorem.
  const Scene scene = make_paper_scene();
  double volume = 0.0;
  for (const auto& t : scene.triangles) {
    volume +=
        glm::dot(position(scene, t.a), glm::cross(position(scene, t.b), position(scene, t.c)));
  }
  EXPECT_GT(volume, 0.0);
}

TEST(SceneBuiltin, DefaultShowsEveryFeatureWithinItsBudget) {
  const Scene scene = make_default_scene();
  EXPECT_GE(scene.triangles.size(), 20'000u);
  EXPECT_LE(scene.triangles.size(), 80'000u);
  std::set<kernels::LightType> lights;
  for (const auto& light : scene.lights) lights.insert(light.type);
  EXPECT_EQ(lights.size(), 3u);
  const auto any = [&](auto&& test) {
    return std::any_of(scene.materials.begin(), scene.materials.end(), test);
  };
  EXPECT_TRUE(any([](const auto& m) { return m.alpha_mode == kernels::AlphaMode::mask; }));
  EXPECT_TRUE(any([](const auto& m) { return m.alpha_mode == kernels::AlphaMode::blend; }));
  EXPECT_TRUE(any([](const auto& m) { return m.unlit != 0; }));
  EXPECT_TRUE(any([](const auto& m) { return m.emissive.x > 1.0f; }));
  EXPECT_TRUE(any([](const auto& m) { return m.metallic == 1.0f; }));
  EXPECT_GE(scene.object_names.size(), 12u);
}

TEST(SceneBuiltin, DefaultNormalsAgreeWithTheWinding) {
  const Scene scene = make_default_scene();
  std::size_t shaded = 0;
  for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
    const auto& geometry = scene.geometries[scene.triangle_geometry[t]];
    const auto& [a, b, c] = scene.triangles[t];
    const glm::dvec3 flat = glm::cross(position(scene, b) - position(scene, a),
                                       position(scene, c) - position(scene, a));
    if (geometry.normals == kernels::kNone) continue;
    for (const std::uint32_t corner : {a, b, c}) {
      const glm::dvec3 n(scene.normals[geometry.normals + corner - geometry.first_vertex]);
      ASSERT_GT(glm::dot(flat, n), 0.0) << scene.object_names[geometry.object];
      ++shaded;
    }
  }
  EXPECT_GT(shaded, 50'000u);
}

TEST(SceneBuiltin, TerrainIsTheGridOfTheBenchmark) {
  const auto scene = make_builtin("terrain:16");
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->triangles.size(), 512u);
  ASSERT_EQ(scene->positions.size(), 289u);
  const auto vertex = [&](std::uint32_t i, std::uint32_t j) { return j * 17 + i; };
  for (std::uint32_t j = 0; j < 16; ++j) {
    for (std::uint32_t i = 0; i < 16; ++i) {
      const auto& p = scene->positions[vertex(i, j)];
      EXPECT_EQ(p.x, static_cast<float>(i));
      EXPECT_EQ(p.z, static_cast<float>(j));
      EXPECT_GE(p.y, 0.0f);
      EXPECT_LE(p.y, 1.5f / (1.0f - 0.48f));  // the sum of all amplitudes
      const auto& first = scene->triangles[2 * (j * 16 + i)];
      const auto& second = scene->triangles[2 * (j * 16 + i) + 1];
      EXPECT_EQ(std::tuple(first.a, first.b, first.c),
                std::tuple(vertex(i, j), vertex(i, j + 1), vertex(i + 1, j)));
      EXPECT_EQ(std::tuple(second.a, second.b, second.c),
                std::tuple(vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)));
    }
  }
  // The same heights at the same places whatever the resolution.
  const auto finer = make_builtin("terrain:32");
  ASSERT_TRUE(finer);
  EXPECT_EQ(scene->positions[vertex(3, 5)], finer->positions[10 * 33 + 6]);
  EXPECT_NEAR(scene->cameras[0].yfov, M_PI / 3.0, 1e-12);
  EXPECT_EQ(scene->cameras[0].matrix[3], glm::dvec4(1, 5, 1, 1));
}

TEST(SceneBuiltin, SoupIsTheSoupOfTheBenchmark) {
  const auto scene = make_builtin("soup:20000");
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->triangles.size(), 20'000u);
  glm::dvec3 sum(0.0);
  double radii = 0.0;
  for (const auto& [a, b, c] : scene->triangles) {
    const glm::dvec3 first = position(*scene, a);
    ASSERT_LE(glm::length(first), 1.0 + 1e-6);
    for (const std::uint32_t other : {b, c}) {
      const glm::dvec3 d = glm::abs(position(*scene, other) - first);
      ASSERT_LE(std::max({d.x, d.y, d.z}), 0.01 + 1e-6);
    }
    sum += first;
    radii += glm::length(first);
  }
  // Uniform in the ball: mean 0 (standard deviation 0.0032 a component), mean radius 3/4 (0.0014).
  EXPECT_LT(glm::length(sum / 20'000.0), 0.025);
  EXPECT_NEAR(radii / 20'000.0, 0.75, 0.007);
  EXPECT_EQ(scene->cameras[0].matrix[3], glm::dvec4(0.5, 0.4, 2.2, 1));
  EXPECT_NEAR(scene->cameras[0].yfov, 50.0 / 180.0 * M_PI, 1e-12);
}

TEST(SceneBuiltin, UnknownNamesAndSizesAreUsageErrors) {
  for (const char* name :
       {"", "nothing", "Default", "paper:2", "default:", "soup:", "soup:0", "soup:-1", "soup:1e6",
        "soup:10x", "soup: 10", "terrain:32768", "terrain:99999999999", "soup:4000000000"}) {
    const auto scene = make_builtin(name);
    ASSERT_FALSE(scene) << name;
    EXPECT_EQ(scene.error().exit, util::Exit::usage) << name;
  }
}

TEST(SceneBuiltin, LimitsAreCheckedBeforeMemoryIsTaken) {
  util::Limits limits;
  limits.max_triangles = 1000;
  EXPECT_EQ(make_builtin("terrain:32767", limits).error().exit, util::Exit::limit);
  EXPECT_TRUE(make_builtin("soup:1000", limits));
  EXPECT_EQ(make_builtin("soup:1001", limits).error().exit, util::Exit::limit);
  limits = {};
  limits.max_scene_bytes = 1 << 20;
  const auto scene = make_builtin("soup:999999999", limits);
  ASSERT_FALSE(scene);
  EXPECT_NE(scene.error().message.find("--max-"), std::string::npos);
}

TEST(SceneBuiltin, SameBitsEverywhere) {
  // Recorded once. A change here means that figures and reference images of these scenes change.
  EXPECT_EQ(fingerprint(make_paper_scene()), 12101150463639563859ull);
  EXPECT_EQ(fingerprint(make_terrain_scene(64)), 2260545577177662416ull);
  EXPECT_EQ(fingerprint(make_soup_scene(1000)), 5660230452880698306ull);
}

TEST(SceneExactMath, SineAndCosineAgreeWithTheLibrary) {
  for (int i = -4000; i <= 4000; ++i) {
    const double turns = i / 997.0;
    const auto [s, c] = sin_cos_turns(turns);
    const double radians = turns * 6.283185307179586;
    ASSERT_NEAR(s, std::sin(radians), 4e-15);
    ASSERT_NEAR(c, std::cos(radians), 4e-15);
  }
  EXPECT_EQ(sin_cos_turns(0.25).sin, 1.0);
  EXPECT_EQ(sin_cos_turns(0.5).sin, 0.0);
  EXPECT_EQ(sin_cos_turns(-0.25).sin, -1.0);
}

}  // namespace
}  // namespace octrace::scene
