// Alpha modes, culling and transparent backgrounds. Unlit surfaces make the colours exact.
#include <gtest/gtest.h>

#include "kernels/path.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using kernels::AlphaMode;
using render::Aov;

constexpr int kSize = 16;

kernels::Material unlit(Vec4 color, AlphaMode mode) {
  kernels::Material material;
  material.unlit = 1;
  material.base_color = color;
  material.alpha_mode = mode;
  return material;
}

void add_wall(scene::Scene& scene, float z, const kernels::Material& material) {
  add_mesh(scene, make_quad({0, 0, z}, 2), add_material(scene, material));
}

Rendered look(const scene::Scene& scene, render::Settings settings = {}) {
  settings.params.sky = Vec3(0.5f, 0.25f, 0.125f);
  return render_scene(scene, orthographic_at({0, 0, 5}, 1), kSize, kSize, settings);
}

bool near(const Vec4& a, const Vec4& b) {
  return glm::all(glm::lessThan(glm::abs(a - b), Vec4(1e-6f)));
}

TEST(Alpha, BlendIsCompositedFrontToBack) {
  scene::Scene scene = empty_scene();
  add_wall(scene, 0, unlit({0, 0, 1, 1}, AlphaMode::opaque));
  add_wall(scene, 2, unlit({1, 0, 0, 0.25f}, AlphaMode::blend));
  add_wall(scene, 1, unlit({0, 1, 0, 0.5f}, AlphaMode::blend));
  const Rendered image = look(scene);
  EXPECT_TRUE(near(image.rgba(7, 3), {0.25f, 0.375f, 0.375f, 1}));
  // Depth is that of the nearest surface, however thin.
  EXPECT_EQ(image.value(Aov::depth, 7, 3), 3.0f);
  EXPECT_EQ(image.id(Aov::object_id, 7, 3), 2u);
  // Three surfaces a sample.
  EXPECT_EQ(image.stats.beauty_rays, 16u * kSize * kSize * 3);
  EXPECT_EQ(image.stats.shadow_rays, 0u);
}

// Through the squares' diagonals, where a ray meets both triangles of each.
TEST(Alpha, BlendCountsAnEdgeOnce) {
  scene::Scene scene = empty_scene();
  add_wall(scene, 0, unlit({0, 0, 1, 1}, AlphaMode::opaque));
  add_wall(scene, 1.3f, unlit({1, 0, 0, 0.25f}, AlphaMode::blend));
  render::Settings settings;
  settings.params.spp = 1;
  const Rendered image = look(scene, settings);
  for (int x = 0; x < kSize; ++x)
    EXPECT_TRUE(near(image.rgba(x, kSize - 1 - x), {0.25f, 0, 0.75f, 1})) << x;
}

TEST(Alpha, IgnoredWhereAsked) {
  scene::Scene scene = empty_scene();
  add_wall(scene, 2, unlit({1, 0, 0, 0.25f}, AlphaMode::blend));
  render::Settings settings;
  settings.params.alpha = 0;
  EXPECT_TRUE(near(look(scene, settings).rgba(2, 2), {1, 0, 0, 1}));
}

TEST(Alpha, OpaqueModeIgnoresAlpha) {
  scene::Scene scene = empty_scene();
  add_wall(scene, 2, unlit({1, 0.5f, 0, 0.25f}, AlphaMode::opaque));
  EXPECT_TRUE(near(look(scene).rgba(2, 2), {1, 0.5f, 0, 1}));
}

TEST(Alpha, BackgroundIsSkyOrTransparent) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_quad({-1, 0, 0}, 1),
           add_material(scene, unlit({0.8f, 0.4f, 0, 0.25f}, AlphaMode::blend)));
  Rendered image = look(scene);
  EXPECT_TRUE(near(image.rgba(2, 8), {0.575f, 0.2875f, 0.09375f, 1}));
  EXPECT_TRUE(near(image.rgba(13, 8), {0.5f, 0.25f, 0.125f, 1}));
  render::Settings settings;
  settings.params.transparent_background = 1;
  image = look(scene, settings);
  EXPECT_TRUE(near(image.rgba(2, 8), {0.2f, 0.1f, 0, 0.25f}));
  EXPECT_TRUE(near(image.rgba(13, 8), Vec4(0.0f)));
}

TEST(Alpha, MaskCutsHolesByTexture) {
  scene::Scene scene = empty_scene();
  kernels::Material leaf = unlit({1, 1, 1, 1}, AlphaMode::mask);
  // A 2 x 2 checkerboard of alpha 0.5 and 0.498: at the cutoff and just below it.
  leaf.base_color_texture.texture =
      add_texture(scene, 2, 2, {0x80ffffffu, 0x7fffffffu, 0x7fffffffu, 0x80ffffffu},
                  kernels::Wrap::repeat, kernels::Filter::nearest, true);
  leaf.alpha_cutoff = 128.0f / 255.0f;
  add_wall(scene, 2, leaf);
  add_wall(scene, 1, unlit({0, 0, 1, 1}, AlphaMode::opaque));
  const Rendered image = look(scene);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const bool solid = (x < kSize / 2) == (y < kSize / 2);
      ASSERT_EQ(image.id(Aov::object_id, x, y), solid ? 1u : 2u);
      ASSERT_EQ(image.value(Aov::depth, x, y), solid ? 3.0f : 4.0f);
      ASSERT_TRUE(near(image.rgba(x, y), solid ? Vec4(1.0f) : Vec4(0, 0, 1, 1)));
    }
  }
}

TEST(Alpha, VertexColoursMultiply) {
  scene::Scene scene = empty_scene();
  MeshData quad = make_quad({0, 0, 0}, 2);
  quad.colors.assign(4, Vec4(0.5f, 0.25f, 1.0f, 0.5f));
  add_mesh(scene, quad, add_material(scene, unlit({1, 1, 0.5f, 0.5f}, AlphaMode::blend)));
  render::Settings settings;
  settings.params.transparent_background = 1;
  const Rendered image = look(scene, settings);
  EXPECT_TRUE(near(image.rgba(4, 4), {0.125f, 0.0625f, 0.125f, 0.25f}));
  EXPECT_EQ(image.vec3(Aov::albedo, 4, 4), Vec3(0.5f, 0.25f, 0.5f));
}

TEST(Alpha, LayersAreBounded) {
  scene::Scene scene = empty_scene();
  for (int i = 0; i < 100; ++i)
    add_wall(scene, 0.02f * static_cast<float>(i), unlit({1, 1, 1, 0.01f}, AlphaMode::blend));
  const Rendered image = look(scene);
  EXPECT_TRUE(near(image.rgba(8, 8), Vec4(1.0f)));
  EXPECT_EQ(image.stats.beauty_rays, std::uint64_t{16} * kSize * kSize * kernels::kMaxLayers);
}

TEST(Culling, FollowsDoubleSided) {
  for (const bool double_sided : {false, true}) {
    for (const std::uint32_t cull : {0u, 1u}) {
      scene::Scene scene = empty_scene();
      kernels::Material material = unlit({1, 0, 0, 1}, AlphaMode::opaque);
      material.double_sided = double_sided;
      MeshData wall = make_quad({0, 0, 1}, 2);
      for (kernels::Triangle& t : wall.triangles) std::swap(t.b, t.c);  // its back to the camera
      add_mesh(scene, wall, add_material(scene, material));
      add_wall(scene, 0, unlit({0, 0, 1, 1}, AlphaMode::opaque));
      render::Settings settings;
      settings.params.cull = cull;
      const Rendered image = look(scene, settings);
      const bool seen = double_sided || cull == 0;
      EXPECT_EQ(image.id(Aov::object_id, 8, 8), seen ? 1u : 2u);
      EXPECT_EQ(image.vec3(Aov::geometric_normal, 8, 8), Vec3(0, 0, 1));
      EXPECT_TRUE(near(image.rgba(8, 8), seen ? Vec4(1, 0, 0, 1) : Vec4(0, 0, 1, 1)));
    }
  }
}

TEST(Culling, BackFacesAreLitLikeFronts) {
  Vec4 color[2];
  for (const bool behind : {false, true}) {
    scene::Scene scene = empty_scene();
    kernels::Material material = matte(Vec3(0.7f), 0.4f);
    material.double_sided = 1;
    MeshData wall = make_quad({0, 0, 1}, 2);
    wall.normals.assign(4, Vec3(0, 0, behind ? -1 : 1));
    if (behind)
      for (kernels::Triangle& t : wall.triangles) std::swap(t.b, t.c);
    add_mesh(scene, wall, add_material(scene, material));
    color[behind] = look(scene).rgba(8, 8);
  }
  EXPECT_TRUE(near(color[0], color[1]));
  EXPECT_GT(color[0].x, 0.2f);
}

}  // namespace
}  // namespace octrace::test
