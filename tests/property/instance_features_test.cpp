// What a surface can have, under instances: beside the same file with a node for each instance,
// which the extension says looks the same, and beside the copies that exporters write.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <string_view>

#include "backend/octree/octree.h"
#include "backend/render/renderer.h"
#include "backend/scene/instances.h"
#include "tests/support/instanced_features.h"

namespace octrace::tests {
namespace {

using render::Aov;
using render::Framebuffer;

constexpr int kWidth = 200, kHeight = 150;

Framebuffer shoot(const scene::Scene& scene, const scene::Camera& camera,
                  octree::Builder builder = octree::Builder::sah) {
  octree::BuildOptions options;
  options.builder = builder;
  const auto tree = octree::build(scene, options);
  EXPECT_TRUE(tree);
  EXPECT_TRUE(octree::verify(*tree, scene));
  Framebuffer image(kWidth, kHeight, *render::parse_aovs("all"));
  render::Settings settings;
  settings.params.spp = 2;
  EXPECT_TRUE(render::make_cpu_renderer(scene, *tree)
                  ->render(scene::make_ray_camera(camera, kWidth, kHeight), settings, image));
  return image;
}

// From the front, from below, and from among the instances.
std::vector<scene::Camera> cameras(const scene::Scene& scene) {
  const scene::Camera front = scene::frame_bounds(scene.bounds, double(kWidth) / kHeight);
  scene::Camera below = front, among = front;
  below.matrix = {{1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}, {0, -5, 0, 1}};
  among.matrix = {{0.8, 0, -0.6, 0}, {0, 1, 0, 0}, {0.6, 0, 0.8, 0}, {1, 0.5, 2, 1}};
  below.yfov = among.yfov = 1.2;
  below.znear = among.znear = 0.01;
  below.zfar = among.zfar = 100.0;
  return {front, below, among};
}

scene::Scene load(const scene::testing::GltfFile& file) { return file.scene(pattern_images()); }

struct Differences {
  std::size_t covered = 0, ids = 0;
  std::map<std::string_view, std::size_t> planes;
};

// `mesh_id`: from a triangle of `expected` to what primitive_id has for it under instances.
Differences compare(const Framebuffer& found, const Framebuffer& expected,
                    const std::function<std::uint32_t(std::uint32_t)>& mesh_id) {
  Differences result;
  const std::size_t pixels = std::size_t{kWidth} * kHeight;
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto id = [&](const Framebuffer& image, Aov aov) { return image.uints(aov)[i]; };
    const std::uint32_t object = id(expected, Aov::object_id);
    const std::uint32_t primitive = id(expected, Aov::primitive_id);
    result.covered += object != 0;
    result.ids += id(found, Aov::object_id) != object ||
                  id(found, Aov::material_id) != id(expected, Aov::material_id) ||
                  id(found, Aov::primitive_id) != (primitive == 0 ? 0 : mesh_id(primitive - 1) + 1);
  }
  for (const render::AovInfo& info : render::aov_table()) {
    // Mirrored copies count their corners the other way round.
    if (info.uint32 || info.aov == Aov::barycentric) continue;
    const auto a = found.floats(info.aov), b = expected.floats(info.aov);
    std::size_t& differing = result.planes[info.option];
    const auto channels = static_cast<std::size_t>(info.channel_count);
    for (std::size_t i = 0; i < pixels; ++i) {
      bool same = true;
      for (std::size_t k = channels * i; k < channels * (i + 1); ++k) {
        const double x = a[k], y = b[k];
        const double limit = info.aov == Aov::beauty ? 1e-3 : 1e-4;
        same &= (std::isinf(x) && std::isinf(y)) ||
                std::abs(x - y) <= limit * std::max(1.0, std::abs(y));
      }
      differing += !same;
    }
  }
  return result;
}

// Pixels whose rays pass within rounding of an edge or of a texel's alpha at the cutoff may differ;
// beauty's go through two places of the pixel, and on to lights, sky and what is mirrored.
constexpr std::size_t kEdgePixels = std::size_t{kWidth} * kHeight / 2000;
constexpr std::size_t kBeautyPixels = 4 * kEdgePixels;

void expect_few(const Differences& found) {
  EXPECT_GT(found.covered, std::size_t{kWidth} * kHeight / 10);
  EXPECT_LE(found.ids, kEdgePixels);
  for (const auto& [plane, pixels] : found.planes) {
    EXPECT_LE(pixels, plane == "beauty" ? kBeautyPixels : kEdgePixels) << plane;
  }
}

TEST(InstanceFeatures, LookLikeANodeForEachInstance) {
  const InstancedPair files = instanced_features();
  const scene::Scene instances = load(files.instances), nodes = load(files.nodes);
  ASSERT_TRUE(instances.instancing);
  ASSERT_FALSE(nodes.instancing);
  const std::size_t own = instances.triangles.size();
  ASSERT_EQ(nodes.triangles.size(), own + instances.instancing->triangles);
  const std::size_t first_object = files.instances.root["nodes"].size();
  const auto mesh_id = [&](std::uint32_t triangle) {
    if (triangle < own) return triangle;
    const std::uint32_t object = nodes.geometries[nodes.triangle_geometry[triangle]].object;
    std::uint32_t first = triangle;
    while (first > own && nodes.geometries[nodes.triangle_geometry[first - 1]].object == object) {
      --first;
    }
    const auto& instance = instances.instancing->instances[object - first_object];
    return instances.instancing->ranges[instance.mesh].first_triangle + (triangle - first);
  };
  for (const scene::Camera& camera : cameras(nodes)) {
    expect_few(compare(shoot(instances, camera), shoot(nodes, camera), mesh_id));
  }
}

// Cut triangles and their alpha, culling, ties: the same bits by every builder.
TEST(InstanceFeatures, HaveTheSameBitsByEveryBuilder) {
  const scene::Scene scene = load(instanced_features().instances);
  ASSERT_TRUE(scene.instancing);
  octree::BuildOptions quality;
  quality.builder = octree::Builder::quality;
  const auto cut = octree::build(scene, quality);
  ASSERT_TRUE(cut);
  EXPECT_GT(cut->instances.triangles.size(), scene.instancing->meshes->triangles.size())
      << "no triangle is cut";
  for (const scene::Camera& camera : cameras(scene)) {
    const Framebuffer expected = shoot(scene, camera);
    for (const octree::Builder builder : {octree::Builder::median, octree::Builder::quality}) {
      const Framebuffer found = shoot(scene, camera, builder);
      for (const render::AovInfo& info : render::aov_table()) {
        const auto bytes = [&](const Framebuffer& image) {
          return info.uint32 ? std::as_bytes(image.uints(info.aov))
                             : std::as_bytes(image.floats(info.aov));
        };
        EXPECT_EQ(0, std::memcmp(bytes(found).data(), bytes(expected).data(), bytes(found).size()))
            << info.option << ", builder " << static_cast<int>(builder);
      }
    }
  }
}

// The copies that exporters write are the nodes' own triangles: the same order, corners, texture
// coordinates and colours; positions and directions within a few units in the last place.
TEST(InstanceFeatures, CopiesAreANodeForEachInstance) {
  const InstancedPair files = instanced_features();
  const scene::Scene nodes = load(files.nodes);
  const auto copies = scene::bake_instances(load(files.instances), {});
  ASSERT_TRUE(copies);
  scene::testing::expect_valid(*copies);
  const auto same_bits = [](const auto& a, const auto& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
  };
  EXPECT_TRUE(same_bits(copies->triangles, nodes.triangles));
  EXPECT_TRUE(same_bits(copies->triangle_geometry, nodes.triangle_geometry));
  EXPECT_TRUE(same_bits(copies->geometries, nodes.geometries));
  EXPECT_TRUE(same_bits(copies->uvs, nodes.uvs));
  EXPECT_TRUE(same_bits(copies->colors, nodes.colors));
  const auto expect_near = [](const auto& a, const auto& b, float limit, const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (int k = 0; k < a[i].length(); ++k) {
        ASSERT_NEAR(a[i][k], b[i][k], limit) << what << ' ' << i;
      }
    }
  };
  expect_near(copies->positions, nodes.positions, 2e-6f, "position");
  expect_near(copies->normals, nodes.normals, 1e-6f, "normal");
  expect_near(copies->tangents, nodes.tangents, 1e-6f, "tangent");
}

}  // namespace
}  // namespace octrace::tests
