#include "exporters/gltf/gltf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <glm/geometric.hpp>

#include "backend/gltf/document.h"
#include "backend/image/image.h"
#include "backend/scene/builtin.h"
#include "backend/scene/flatten.h"
#include "tests/unit/exporters_scene.h"

namespace octrace::test {
namespace {

util::Result<scene::DecodedImage> decode(std::span<const std::uint8_t> bytes,
                                         const std::string& mime, const util::Limits& limits) {
  auto decoded = image::decode(bytes, mime, limits);
  if (!decoded) return decoded.error();
  return scene::DecodedImage{decoded->width, decoded->height, std::move(decoded->texels)};
}

scene::Scene load(const std::string& path) {
  const auto document = gltf::load(path, {});
  if (!document) {
    ADD_FAILURE() << document.error().to_string();
    return {};
  }
  scene::FlattenOptions options;
  options.decode = decode;
  auto scene = scene::flatten(*document, options);
  if (!scene) {
    ADD_FAILURE() << scene.error().to_string();
    return {};
  }
  return std::move(*scene);
}

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void expect_near(const kernels::Vec3& a, const kernels::Vec3& b, float error) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], error);
}

void expect_same_texture(const scene::Scene& a, const kernels::TextureRef& ra,
                         const scene::Scene& b, const kernels::TextureRef& rb) {
  ASSERT_EQ(ra.texture == kernels::kNone, rb.texture == kernels::kNone);
  if (ra.texture == kernels::kNone) return;
  const kernels::Texture &ta = a.textures[ra.texture], &tb = b.textures[rb.texture];
  ASSERT_EQ(ta.width, tb.width);
  ASSERT_EQ(ta.height, tb.height);
  EXPECT_EQ(ta.wrap_s, tb.wrap_s);
  EXPECT_EQ(ta.wrap_t, tb.wrap_t);
  EXPECT_EQ(ta.filter, tb.filter);
  EXPECT_EQ(0, std::memcmp(&a.texels[ta.first_texel], &b.texels[tb.first_texel],
                           sizeof(std::uint32_t) * ta.width * ta.height));
  EXPECT_EQ(ra.texcoord, rb.texcoord);
  expect_near(ra.transform_u, rb.transform_u, 1e-6f);
  expect_near(ra.transform_v, rb.transform_v, 1e-6f);
}

void expect_same_scene(const scene::Scene& a, const scene::Scene& b) {
  EXPECT_TRUE(same_bytes(a.positions, b.positions));
  EXPECT_TRUE(same_bytes(a.triangles, b.triangles));
  EXPECT_TRUE(same_bytes(a.triangle_geometry, b.triangle_geometry));
  ASSERT_EQ(a.geometries.size(), b.geometries.size());
  for (std::size_t i = 0; i < a.geometries.size(); ++i) {
    EXPECT_EQ(a.geometries[i].object, b.geometries[i].object);
    EXPECT_EQ(a.geometries[i].material, b.geometries[i].material);
  }
  for (std::size_t i = 0; i < a.object_names.size(); ++i) {
    EXPECT_EQ(a.object_names[i], b.object_names[i]);
  }
  ASSERT_LE(a.materials.size(), b.materials.size());
  for (std::size_t i = 0; i < a.materials.size(); ++i) {
    const kernels::Material &ma = a.materials[i], &mb = b.materials[i];
    SCOPED_TRACE(a.material_names[i]);
    EXPECT_EQ(ma.base_color, mb.base_color);
    expect_near(ma.emissive, mb.emissive, 1e-5f * std::max(1.0f, glm::length(ma.emissive)));
    EXPECT_EQ(ma.metallic, mb.metallic);
    EXPECT_EQ(ma.roughness, mb.roughness);
    EXPECT_EQ(ma.alpha_mode, mb.alpha_mode);
    if (ma.alpha_mode == kernels::AlphaMode::mask) {
      EXPECT_EQ(ma.alpha_cutoff, mb.alpha_cutoff);
    }
    EXPECT_EQ(ma.double_sided, mb.double_sided);
    EXPECT_EQ(ma.unlit, mb.unlit);
    expect_same_texture(a, ma.base_color_texture, b, mb.base_color_texture);
    expect_same_texture(a, ma.metallic_roughness_texture, b, mb.metallic_roughness_texture);
    expect_same_texture(a, ma.normal_texture, b, mb.normal_texture);
    expect_same_texture(a, ma.occlusion_texture, b, mb.occlusion_texture);
    expect_same_texture(a, ma.emissive_texture, b, mb.emissive_texture);
  }
  ASSERT_EQ(a.lights.size(), b.lights.size());
  for (std::size_t i = 0; i < a.lights.size(); ++i) {
    const kernels::Light &la = a.lights[i], &lb = b.lights[i];
    EXPECT_EQ(la.type, lb.type);
    EXPECT_EQ(la.range, lb.range);
    expect_near(la.intensity, lb.intensity, 1e-5f * glm::length(la.intensity));
    if (la.type != kernels::LightType::directional) expect_near(la.position, lb.position, 1e-6f);
    if (la.type != kernels::LightType::point) expect_near(la.direction, lb.direction, 1e-6f);
    if (la.type == kernels::LightType::spot) {
      EXPECT_NEAR(la.spot_scale, lb.spot_scale, 1e-4f * la.spot_scale);
      EXPECT_NEAR(la.spot_offset, lb.spot_offset, 1e-4f * std::abs(la.spot_offset));
    }
  }
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].name, b.cameras[i].name);
    EXPECT_EQ(a.cameras[i].type, b.cameras[i].type);
    if (a.cameras[i].type == scene::CameraType::orthographic) {
      EXPECT_EQ(a.cameras[i].xmag, b.cameras[i].xmag);
      EXPECT_EQ(a.cameras[i].ymag, b.cameras[i].ymag);
      EXPECT_EQ(a.cameras[i].zfar, b.cameras[i].zfar);
    } else {
      EXPECT_EQ(a.cameras[i].yfov, b.cameras[i].yfov);
      // glTF has no near plane at the eye itself.
      const double znear = a.cameras[i].znear;
      EXPECT_NEAR(b.cameras[i].znear, znear, znear > 0.0 ? 0.0 : 1e-4);
    }
    for (int c = 0; c < 4; ++c) {
      const glm::dvec4 x = a.cameras[i].matrix[c], y = b.cameras[i].matrix[c];
      EXPECT_LT(glm::length(x - y), 1e-9) << "camera " << i << ", column " << c;
    }
  }
}

void expect_round_trip(const scene::Scene& scene) {
  const TemporaryFolder folder;
  const auto file = exporters::write_gltf(scene, folder.file("scene.glb"));
  ASSERT_TRUE(file) << file.error().to_string();
  EXPECT_EQ(file->bytes, std::filesystem::file_size(folder.file("scene.glb")));
  expect_same_scene(scene, load(folder.file("scene.glb")));
  // The texture that was encoded on the way is gone.
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path()))
    ++files;
  EXPECT_EQ(files, 1u);
}

scene::Scene scene_with_everything() {
  scene::Scene scene = varied_scene();
  kernels::Material material;
  material.base_color = {0.25f, 0.5f, 0.75f, 1.0f};
  material.emissive = {4.0f, 2.0f, 0.5f};
  material.metallic = 0.3f;
  material.roughness = 0.6f;
  material.unlit = 1;
  material.emissive_texture.texture = 0;
  material.normal_texture.texture = 1;
  material.normal_scale = 0.5f;
  material.normal_texture.transform_u = {0.5f, 1.2f, 0.1f};
  material.normal_texture.transform_v = {-0.3f, 2.0f, 0.2f};
  add_material(scene, material, "everything \"quoted\" ☃");
  Part ball = sphere("everything", {0, 0, 0}, 0.5f);
  ball.material = static_cast<std::uint32_t>(scene.materials.size()) - 1;
  for (std::size_t i = 0; i < ball.positions.size(); ++i) {
    ball.colors.push_back({static_cast<float>(i % 3) / 2.0f, 0.5f, 1.0f, 1.0f});
  }
  add_part(scene, ball);
  const glm::vec3 down = glm::normalize(glm::vec3(0.1f, -1.0f, 0.2f));
  scene.lights = {{kernels::LightType::directional, {}, {0, -1, 0}, {3, 2, 1}, INFINITY, 0, 0},
                  {kernels::LightType::point, {1, 2, 3}, {}, {50, 60, 70}, 25.0f, 0, 0},
                  {kernels::LightType::spot, {1, 2, 3}, down, {9, 9, 9}, INFINITY, 12.5f, -9.75f}};
  scene.cameras.push_back(look_at({3, 2, 5}, {0, 0, 0}, 0.7));
  scene.cameras.back().name = "main";
  scene.cameras.back().znear = 0.125;
  scene.cameras.push_back(look_at({-3, 2, 5}, {0, 1, 0}, 0.7));
  scene.cameras.back().name = "flat";
  scene.cameras.back().type = scene::CameraType::orthographic;
  scene.cameras.back().zfar = 100.0;
  scene.cameras.back().xmag = -2.0;
  finish(scene);
  return scene;
}

TEST(GltfExport, KeepsEverythingThatItCanExpress) { expect_round_trip(scene_with_everything()); }

TEST(GltfExport, KeepsTheBuiltinScenes) {
  for (const char* name : {"default", "paper", "terrain:40", "soup:300"}) {
    SCOPED_TRACE(name);
    const auto scene = scene::make_builtin(name);
    ASSERT_TRUE(scene) << scene.error().to_string();
    expect_round_trip(*scene);
  }
}

TEST(GltfExport, WritesShortAndLongIndices) {
  for (const int rings : {60, 700}) {  // 1 505 and 70 801 vertices at 24 and 100 around
    scene::Scene scene;
    add_material(scene, {});
    add_part(scene, sphere("ball", {0, 0, 0}, 1.0f, rings == 60 ? 24 : 100, rings));
    finish(scene);
    expect_round_trip(scene);
  }
}

TEST(GltfExport, RepairsWhatGltfForbids) {
  scene::Scene scene;
  add_material(scene, {});
  Part part = card("card", {0, 0, 0}, 1, 1);
  part.normals = {{0, 0, 0}, {0, 0, 5}, {NAN, 0, 1}, {0, 1, 0}};
  part.uvs[2] = {INFINITY, NAN};
  part.colors = {{2, -1, 0.5f, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {NAN, 1, 1, 1}};
  add_part(scene, part);
  finish(scene);
  const TemporaryFolder folder;
  const auto file = exporters::write_gltf(scene, folder.file("scene.glb"));
  ASSERT_TRUE(file) << file.error().to_string();
  EXPECT_EQ(file->notes.size(), 1u);
  const scene::Scene back = load(folder.file("scene.glb"));
  ASSERT_EQ(back.normals.size(), 4u);
  for (const auto& normal : back.normals) EXPECT_NEAR(glm::length(normal), 1.0f, 1e-6f);
  EXPECT_EQ(back.normals[1], kernels::Vec3(0, 0, 1));
  EXPECT_EQ(back.colors[0], kernels::Vec4(1, 0, 0.5f, 1));
}

TEST(GltfExport, ReportsAFolderThatIsNotThere) {
  const auto file = exporters::write_gltf(varied_scene(), "/nowhere/at/all/scene.glb");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().exit, util::Exit::io);
}

}  // namespace
}  // namespace octrace::test
