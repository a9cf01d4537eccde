// Geometry AOVs against closed forms, and against the same kernels over all triangles.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <random>

#include "kernels/pixel.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using glm::dvec3;
using render::Aov;

constexpr int kWidth = 64, kHeight = 48;
constexpr double kYfov = 0.8;

// The pixel's ray from the definition in docs: planar depth 1, image plane spanned by yfov.
dvec3 pinhole_direction(int x, int y) {
  const double half = std::tan(kYfov / 2);
  return {(2 * (x + 0.5) / kWidth - 1) * half * kWidth / kHeight,
          (1 - 2 * (y + 0.5) / kHeight) * half, -1.0};
}

// z = 0.3 x - 0.2 y - 1, seen from +z.
scene::Scene tilted_plane() {
  scene::Scene scene = empty_scene();
  MeshData quad = make_quad({0, 0, 0}, 8);
  for (Vec3& p : quad.positions) p.z = 0.3f * p.x - 0.2f * p.y - 1.0f;
  add_mesh(scene, quad, add_material(scene, matte({0.25f, 0.5f, 0.75f})));
  return scene;
}

TEST(GeometryAovs, TiltedPlaneInPerspective) {
  const dvec3 eye(0.5, 0.25, 4);
  const dvec3 normal = glm::normalize(dvec3(-0.3, 0.2, 1));
  const Rendered image = render_scene(tilted_plane(), camera_at(Vec3(eye), kYfov), kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const dvec3 d = pinhole_direction(x, y);
      const double t = glm::dot(normal, dvec3(0, 0, -1) - eye) / glm::dot(normal, d);
      const dvec3 p = eye + t * d;
      ASSERT_NEAR(image.value(Aov::depth, x, y), t, 3e-6 * t);
      ASSERT_NEAR(image.value(Aov::distance, x, y), t * glm::length(d), 4e-6 * t);
      ASSERT_EQ(image.value(Aov::mask, x, y), 1.0f);
      ASSERT_EQ(image.id(Aov::object_id, x, y), 1u);
      ASSERT_EQ(image.id(Aov::material_id, x, y), 2u);
      ASSERT_LE(glm::length(dvec3(image.vec3(Aov::position, x, y)) - p), 1e-5);
      ASSERT_LE(glm::length(dvec3(image.vec3(Aov::normal, x, y)) - normal), 1e-6);
      ASSERT_LE(glm::length(dvec3(image.vec3(Aov::geometric_normal, x, y)) - normal), 1e-6);
      ASSERT_EQ(image.vec3(Aov::albedo, x, y), Vec3(0.25f, 0.5f, 0.75f));
      const auto uv =
          &image.framebuffer.floats(Aov::uv)[2 * static_cast<std::size_t>(y * kWidth + x)];
      ASSERT_NEAR(uv[0], (p.x + 8) / 16, 2e-6);
      ASSERT_NEAR(uv[1], (8 - p.y) / 16, 2e-6);
      // The upper left triangle is the second.
      const std::uint32_t id = image.id(Aov::primitive_id, x, y);
      if (std::abs(p.x - p.y) > 1e-4) {
        ASSERT_EQ(id, p.y > p.x ? 2u : 1u);
      }
      const auto bary =
          &image.framebuffer.floats(Aov::barycentric)[2 * static_cast<std::size_t>(y * kWidth + x)];
      ASSERT_TRUE(bary[0] >= 0 && bary[1] >= 0 && bary[0] + bary[1] <= 1.000001f);
    }
  }
  EXPECT_EQ(image.stats.camera_rays, static_cast<std::uint64_t>(kWidth * kHeight));
}

TEST(GeometryAovs, SphereInPerspectiveAndOrthographic) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0.3f, -0.2f, -1}, 1, 512, 256, true), 0);
  const dvec3 centre(0.3, -0.2, -1), eye(0, 0, 3);
  for (const bool orthographic : {false, true}) {
    const double half_height = 1.5;
    const Rendered image = render_scene(
        scene, orthographic ? orthographic_at(Vec3(eye), half_height) : camera_at(Vec3(eye), kYfov),
        kWidth, kHeight);
    int hits = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        dvec3 o = eye, d = pinhole_direction(x, y);
        if (orthographic) {
          d = {0, 0, -1};
          o += dvec3((2 * (x + 0.5) / kWidth - 1) * half_height * kWidth / kHeight,
                     (1 - 2 * (y + 0.5) / kHeight) * half_height, 0);
        }
        const dvec3 m = o - centre;
        const double a = glm::dot(d, d), b = glm::dot(m, d), c = glm::dot(m, m) - 1;
        const double inside = b * b - a * c;
        // The mesh lies within 1.5e-4 of the sphere: rays closer to tangential may differ.
        const double miss = 1 + c - b * b / a;  // squared distance of the ray from the centre
        if (miss > 0.99 && miss < 1.001) continue;
        if (inside < 0) {
          ASSERT_EQ(image.value(Aov::mask, x, y), 0.0f);
          ASSERT_TRUE(std::isinf(image.value(Aov::depth, x, y)));
          ASSERT_TRUE(std::isinf(image.value(Aov::distance, x, y)));
          ASSERT_EQ(image.vec3(Aov::normal, x, y), Vec3(0.0f));
          ASSERT_EQ(image.vec3(Aov::position, x, y), Vec3(0.0f));
          ASSERT_EQ(image.id(Aov::primitive_id, x, y), 0u);
          ASSERT_EQ(image.id(Aov::object_id, x, y), 0u);
          continue;
        }
        ++hits;
        const double t = (-b - std::sqrt(inside)) / a;
        const dvec3 n = o + t * d - centre;
        ASSERT_NEAR(image.value(Aov::depth, x, y), t, 2e-3);
        ASSERT_NEAR(image.value(Aov::distance, x, y), t * std::sqrt(a), 2e-3);
        ASSERT_LE(glm::length(dvec3(image.vec3(Aov::normal, x, y)) - n), 3e-3);
        ASSERT_LE(glm::length(dvec3(image.vec3(Aov::geometric_normal, x, y)) - n), 0.02);
      }
    }
    EXPECT_GT(hits, 500);
  }
}

struct BruteTracer {
  kernels::TraceStatus closest(const kernels::SceneView& scene, const kernels::RenderParams&,
                               const kernels::Ray& ray, kernels::Hit* hit) const {
    *hit = {ray.tmax, 0, 0, kernels::kNone};
    const auto slab = kernels::make_slab_ray(ray);
    const auto prepared = kernels::make_triangle_ray(ray.direction);
    for (std::uint32_t i = 0; i < scene.triangles.size; ++i) {
      const kernels::Triangle& t = scene.triangles[i];
      const auto& material = scene.materials[scene.geometries[scene.triangle_geometry[i]].material];
      kernels::TriangleHit found;
      if (kernels::intersect_triangle(slab, prepared, scene.positions[t.a], scene.positions[t.b],
                                      scene.positions[t.c], ray.tmin, hit->t,
                                      material.double_sided == 0, &found) &&
          (!hit->valid() || found.t < hit->t)) {
        *hit = {found.t, found.u, found.v, i};
      }
    }
    return kernels::TraceStatus::ok;
  }
};

TEST(GeometryAovs, EqualBruteForceBitForBit) {
  scene::Scene scene = empty_scene();
  std::mt19937 random(17);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<std::uint32_t> texels(64);
  for (auto& texel : texels) texel = random();
  kernels::Material textured = matte({0.9f, 0.8f, 0.7f});
  textured.double_sided = 1;
  textured.normal_texture.texture =
      add_texture(scene, 8, 8, texels, kernels::Wrap::mirror, kernels::Filter::linear, false);
  textured.base_color_texture.texture =
      add_texture(scene, 8, 8, texels, kernels::Wrap::repeat, kernels::Filter::linear, true);
  const auto material = add_material(scene, textured);
  for (int i = 0; i < 150; ++i) {
    MeshData mesh;
    for (int k = 0; k < 3; ++k) {
      mesh.positions.push_back({uniform(random), uniform(random), uniform(random)});
      mesh.normals.push_back({uniform(random), uniform(random), uniform(random)});
      mesh.uvs.push_back({3 * uniform(random), 3 * uniform(random)});
      mesh.colors.push_back(Vec4(uniform(random) * 0.5f + 0.5f));
    }
    mesh.triangles = {{0, 1, 2}};
    add_mesh(scene, mesh, i % 2 == 0 ? material : 0);
  }
  const scene::Camera camera = camera_at({0, 0, 2.5f}, kYfov);
  const Rendered image = render_scene(scene, camera, kWidth, kHeight, {}, "all");
  render::Framebuffer brute(kWidth, kHeight, image.framebuffer.aovs());
  const auto view = scene.view();
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x)
      kernels::trace_geometry(view, scene::make_ray_camera(camera, kWidth, kHeight), {},
                              brute.view(), x, y, BruteTracer{});
  for (const render::AovInfo& info : render::aov_table()) {
    if (info.aov == Aov::beauty) continue;
    const std::size_t bytes = static_cast<std::size_t>(kWidth * kHeight * info.channel_count) * 4;
    const void* a = info.uint32 ? static_cast<const void*>(image.framebuffer.uints(info.aov).data())
                                : image.framebuffer.floats(info.aov).data();
    const void* b = info.uint32 ? static_cast<const void*>(brute.uints(info.aov).data())
                                : brute.floats(info.aov).data();
    EXPECT_EQ(std::memcmp(a, b, bytes), 0) << info.option;
  }
}

Vec3 normal_of_texel(std::uint32_t texel, bool behind, bool tangents, bool mirrored, float scale) {
  scene::Scene scene = empty_scene();
  kernels::Material material = matte(Vec3(0.5f));
  material.double_sided = 1;
  material.normal_scale = scale;
  material.normal_texture.texture =
      add_texture(scene, 1, 1, {texel}, kernels::Wrap::repeat, kernels::Filter::linear, false);
  MeshData quad = make_quad({0, 0, 0}, 4);
  if (mirrored)
    for (Vec2& uv : quad.uvs) uv.x = 1 - uv.x;
  const auto geometry = add_mesh(scene, quad, add_material(scene, material));
  if (tangents) {
    scene.geometries[geometry].tangents = 0;
    scene.tangents.assign(4, mirrored ? Vec4(-1, 0, 0, -1) : Vec4(1, 0, 0, 1));
  }
  scene::Camera camera = camera_at({0, 0, 3}, kYfov);
  if (behind) camera.matrix = glm::dmat4({-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, -1, 0}, {0, 0, -3, 1});
  return render_scene(scene, camera, 8, 8, {}, "normal").vec3(Aov::normal, 4, 4);
}

// glTF: red is +x along the first texture coordinate, green points up the image.
TEST(GeometryAovs, NormalTexture) {
  const auto texel = [](int r, int g, int b) {
    return static_cast<std::uint32_t>(r | g << 8 | b << 16) | 0xff000000u;
  };
  const auto expected = [](double r, double g, double b, double scale) {
    return Vec3(glm::normalize(
        dvec3((2 * r / 255 - 1) * scale, (2 * g / 255 - 1) * scale, 2 * b / 255 - 1)));
  };
  for (const bool tangents : {false, true}) {
    for (const float scale : {1.0f, 0.5f}) {
      const Vec3 n = expected(204, 178, 229, scale);
      const auto got = [&](bool behind, bool mirrored) {
        return normal_of_texel(texel(204, 178, 229), behind, tangents, mirrored, scale);
      };
      EXPECT_LE(glm::length(got(false, false) - n), 1e-5f);
      EXPECT_LE(glm::length(got(true, false) + n), 1e-5f);
      EXPECT_LE(glm::length(got(false, true) - Vec3(-n.x, n.y, n.z)), 1e-5f);
    }
  }
}

TEST(GeometryAovs, NormalsFaceTheViewerFromBothSides) {
  scene::Scene scene = empty_scene();
  kernels::Material material = matte(Vec3(0.5f));
  material.double_sided = 1;
  const auto index = add_material(scene, material);
  MeshData ball = make_ball({0, 0, 0}, 1, 64, 32, true);
  add_mesh(scene, ball, index);
  for (const float z : {3.0f, 0.0f}) {  // outside, and in the middle
    const Rendered image = render_scene(scene, camera_at({0, 0, z}, kYfov), kWidth, kHeight, {},
                                        "normal,Ng,position,mask");
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (image.value(Aov::mask, x, y) == 0.0f) continue;
        const Vec3 d(pinhole_direction(x, y)), p = image.vec3(Aov::position, x, y);
        const Vec3 ng = image.vec3(Aov::geometric_normal, x, y);
        const Vec3 n = image.vec3(Aov::normal, x, y);
        ASSERT_LT(glm::dot(ng, d), 1e-3f);
        ASSERT_GT(glm::dot(ng, n), 0.9f);
        ASSERT_LE(glm::length(n - (z > 0 ? p : -p)), 5e-3f);
      }
    }
  }
}

// The base colour's texture reads the second set, turned by a quarter; the uv plane stays the
// first.
TEST(GeometryAovs, SecondTextureCoordinatesAndTransform) {
  scene::Scene scene = empty_scene();
  kernels::Material material = matte(Vec3(1.0f));
  material.base_color_texture.texture =
      add_texture(scene, 2, 1, {0xff0000ffu, 0xff00ff00u}, kernels::Wrap::repeat,
                  kernels::Filter::nearest, true);
  material.base_color_texture.texcoord = 1;
  material.base_color_texture.transform_u = {0, 1, 0};
  material.base_color_texture.transform_v = {-1, 0, 0};
  const auto geometry = add_mesh(scene, make_quad({0, 0, 0}, 1), add_material(scene, material));
  scene.geometries[geometry].uv1 = static_cast<std::uint32_t>(scene.uvs.size());
  for (const Vec2& uv : {Vec2(0, 2), Vec2(2, 2), Vec2(2, 0), Vec2(0, 0)}) scene.uvs.push_back(uv);
  const Rendered image =
      render_scene(scene, orthographic_at({0, 0, 2}, 1), 16, 16, {}, "albedo,uv");
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      // Downwards over the image v runs from 0 to 2, that is two repeats of red and green.
      const bool red = y / 4 % 2 == 0;
      ASSERT_EQ(image.vec3(Aov::albedo, x, y), red ? Vec3(1, 0, 0) : Vec3(0, 1, 0))
          << x << " " << y;
      const auto uv = &image.framebuffer.floats(Aov::uv)[2 * static_cast<std::size_t>(y * 16 + x)];
      ASSERT_NEAR(uv[0], (x + 0.5) / 16, 1e-6);
    }
  }
}

TEST(GeometryAovs, DoNotDependOnSamples) {
  scene::Scene scene = tilted_plane();
  render::Settings one, many;
  one.params.spp = 1;
  many.params.spp = 9;
  many.params.seed = 5;
  const scene::Camera camera = camera_at({0, 0, 3}, kYfov);
  const Rendered a = render_scene(scene, camera, 24, 16, one);
  const Rendered b = render_scene(scene, camera, 24, 16, many);
  const auto za = a.framebuffer.floats(Aov::depth), zb = b.framebuffer.floats(Aov::depth);
  EXPECT_TRUE(std::equal(za.begin(), za.end(), zb.begin()));
}

}  // namespace
}  // namespace octrace::test
