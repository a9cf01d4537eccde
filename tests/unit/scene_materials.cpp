#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::base64;
using testing::expect_valid;
using testing::GltfFile;
using testing::json;

// A PNG by its structure only. The decoder below is a stand-in that reads the size and one byte of
// data, by which images are told apart.
std::string png(std::uint8_t width, std::uint8_t height, char tag) {
  std::string bytes("\x89PNG\r\n\x1a\n", 8);
  const auto chunk = [&](const std::string& type, const std::string& data) {
    bytes += std::string(3, '\0') + static_cast<char>(data.size()) + type + data;
    bytes += std::string(4, '\0');  // a checksum is the real decoder's business
  };
  const auto number = [](std::uint8_t n) { return std::string(3, '\0') + static_cast<char>(n); };
  chunk("IHDR", number(width) + number(height) + std::string("\x08\x06\0\0\0", 5));
  chunk("IDAT", std::string(1, tag));
  chunk("IEND", "");
  return bytes;
}

std::string uri(const std::string& bytes) { return "data:image/png;base64," + base64(bytes); }

struct Decoder {
  std::atomic<int> calls{0};
  char broken = '\0';

  ImageDecoder function() {
    return [this](std::span<const std::uint8_t> bytes, const std::string&,
                  const util::Limits&) -> util::Result<DecodedImage> {
      ++calls;
      DecodedImage image;
      image.width = bytes[19];
      image.height = bytes[23];
      if (static_cast<char>(bytes[41]) == broken) {
        return util::Error{util::Exit::invalid_input, "IMAGE_DATA_INVALID", "broken", "", ""};
      }
      image.texels.assign(std::size_t{image.width} * image.height, bytes[41]);
      return image;
    };
  }
};

GltfFile one_triangle() {
  GltfFile file;
  const int uv = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
  const int uv1 = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
  file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
            {{"attributes", {{"TEXCOORD_0", uv}, {"TEXCOORD_1", uv1}}}, {"material", 0}});
  file.append("nodes", {{"mesh", 0}});
  file.append("scenes", {{"nodes", {0}}});
  return file;
}

TEST(SceneMaterials, FactorsAndExtensions) {
  GltfFile file = one_triangle();
  file.root["extensionsUsed"] = {"KHR_materials_unlit", "KHR_materials_emissive_strength"};
  file.append("materials", {{"name", "full"},
                            {"pbrMetallicRoughness",
                             {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}},
                              {"metallicFactor", 0.25},
                              {"roughnessFactor", 0.75}}},
                            {"emissiveFactor", {1, 0.5, 0}},
                            {"alphaMode", "MASK"},
                            {"alphaCutoff", 0.3},
                            {"doubleSided", true}});
  file.root["materials"][0]["extensions"] = {
      {"KHR_materials_unlit", json::object()},
      {"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}};
  file.append("materials", {{"alphaMode", "BLEND"}});
  const Scene scene = file.scene();
  expect_valid(scene);
  ASSERT_EQ(scene.materials.size(), 2u) << "every primitive names a material";
  const auto& full = scene.materials[0];
  EXPECT_EQ(full.base_color, kernels::Vec4(0.1f, 0.2f, 0.3f, 0.4f));
  EXPECT_EQ(full.metallic, 0.25f);
  EXPECT_EQ(full.roughness, 0.75f);
  EXPECT_EQ(full.emissive, kernels::Vec3(8, 4, 0));
  EXPECT_EQ(full.alpha_mode, kernels::AlphaMode::mask);
  EXPECT_EQ(full.alpha_cutoff, 0.3f);
  EXPECT_EQ(full.double_sided, 1u);
  EXPECT_EQ(full.unlit, 1u);
  const auto& plain = scene.materials[1];
  EXPECT_EQ(plain.base_color, kernels::Vec4(1.0f));
  EXPECT_EQ(plain.metallic, 1.0f);
  EXPECT_EQ(plain.roughness, 1.0f);
  EXPECT_EQ(plain.alpha_mode, kernels::AlphaMode::blend);
  EXPECT_EQ(plain.double_sided, 0u);
  EXPECT_EQ(plain.unlit, 0u);
  EXPECT_EQ(scene.material_names, (std::vector<std::string>{"full", "material 1"}));
}

TEST(SceneMaterials, DefaultComesLastWhereAPrimitiveNamesNone) {
  GltfFile file = one_triangle();
  file.append("materials", {{"name", "red"}});
  const int bare = file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.append("nodes", {{"mesh", bare}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  const Scene scene = file.scene();
  expect_valid(scene);
  ASSERT_EQ(scene.materials.size(), 2u);
  EXPECT_EQ(scene.geometries[0].material, 0u);
  EXPECT_EQ(scene.geometries[1].material, 1u);
  EXPECT_EQ(scene.material_names.back(), "default");
}

// Image 0 as colour and as data, image 1 with the same bytes, image 2 another.
GltfFile textured() {
  GltfFile file = one_triangle();
  file.append("images", {{"uri", uri(png(4, 2, 'a'))}});
  file.append("images", {{"uri", uri(png(4, 2, 'a'))}});
  file.append("images", {{"uri", uri(png(3, 3, 'b'))}});
  file.append("samplers", {{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}});
  file.append("textures", {{"source", 0}});
  file.append("textures", {{"source", 1}, {"sampler", 0}});
  file.append("textures", {{"source", 2}});
  file.append("textures", {{"source", 0}});
  file.append(
      "materials",
      {{"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", 0}}}, {"metallicRoughnessTexture", {{"index", 3}}}}},
       {"normalTexture", {{"index", 1}, {"scale", 0.5}, {"texCoord", 1}}},
       {"occlusionTexture", {{"index", 2}, {"strength", 0.25}}},
       {"emissiveTexture", {{"index", 3}}}});
  return file;
}

TEST(SceneMaterials, TexturesShareTexelsAndKnowTheirEncoding) {
  Decoder decoder;
  FlattenOptions options;
  options.decode = decoder.function();
  const Scene scene = textured().scene(options);
  expect_valid(scene);
  ASSERT_EQ(decoder.calls, 2) << "equal images are decoded once";
  EXPECT_EQ(scene.texels.size(), 4u * 2u + 3u * 3u);
  const auto& material = scene.materials[0];
  const auto texture = [&](const kernels::TextureRef& ref) { return scene.textures[ref.texture]; };
  EXPECT_EQ(texture(material.base_color_texture).srgb, 1u);
  EXPECT_EQ(texture(material.emissive_texture).srgb, 1u);
  EXPECT_EQ(texture(material.metallic_roughness_texture).srgb, 0u);
  EXPECT_EQ(texture(material.normal_texture).srgb, 0u);
  EXPECT_EQ(texture(material.occlusion_texture).srgb, 0u);
  EXPECT_EQ(material.base_color_texture.texture, material.emissive_texture.texture);
  EXPECT_EQ(texture(material.base_color_texture).first_texel,
            texture(material.normal_texture).first_texel);
  EXPECT_EQ(material.normal_texture.texcoord, 1u);
  EXPECT_EQ(material.normal_scale, 0.5f);
  EXPECT_EQ(material.occlusion_strength, 0.25f);
  const auto sampled = texture(material.normal_texture);
  EXPECT_EQ(sampled.wrap_s, kernels::Wrap::clamp);
  EXPECT_EQ(sampled.wrap_t, kernels::Wrap::mirror);
  EXPECT_EQ(sampled.filter, kernels::Filter::nearest);
  EXPECT_EQ(texture(material.base_color_texture).filter, kernels::Filter::linear);
  const auto other = texture(material.occlusion_texture);
  EXPECT_EQ(other.width, 3u);
  EXPECT_EQ(scene.texels[other.first_texel], static_cast<std::uint32_t>('b'));
}

TEST(SceneMaterials, OnlyAlphaTestsNeedTexturesWithoutBeauty) {
  Decoder decoder;
  FlattenOptions options;
  options.decode = decoder.function();
  options.need_textures = false;
  GltfFile file = textured();
  EXPECT_EQ(file.scene(options).textures.size(), 0u);
  EXPECT_EQ(decoder.calls, 0);
  file.root["materials"][0]["alphaMode"] = "MASK";
  const Scene masked = file.scene(options);
  EXPECT_EQ(decoder.calls, 1);
  ASSERT_EQ(masked.textures.size(), 1u);
  EXPECT_EQ(masked.materials[0].base_color_texture.texture, 0u);
  EXPECT_EQ(masked.materials[0].emissive_texture.texture, kernels::kNone);
}

TEST(SceneMaterials, BrokenImagesAreErrorsOrWarnings) {
  Decoder decoder;
  decoder.broken = 'b';
  FlattenOptions options;
  options.decode = decoder.function();
  const gltf::Document document = textured().document();
  const auto failed = flatten(document, options);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, "IMAGE_DATA_INVALID");
  EXPECT_EQ(failed.error().pointer, "/images/2");
  EXPECT_FALSE(failed.error().file.empty());
  options.missing_images_warn = true;
  const auto warned = flatten(document, options);
  ASSERT_TRUE(warned);
  expect_valid(*warned);
  EXPECT_EQ(warned->materials[0].occlusion_texture.texture, kernels::kNone);
  EXPECT_NE(warned->materials[0].base_color_texture.texture, kernels::kNone);
  ASSERT_EQ(warned->warnings.size(), 1u);
  EXPECT_NE(warned->warnings[0].find("/images/2"), std::string::npos);
}

TEST(SceneMaterials, TexelsCountAgainstTheSceneLimit) {
  Decoder decoder;
  FlattenOptions options;
  options.decode = decoder.function();
  const gltf::Document document = textured().document();
  // Every limit either holds or is named, and texels, twice 17 of 4 bytes, are part of what counts.
  const auto least = [&] {
    for (std::uint64_t bytes = 1;; ++bytes) {
      options.limits.max_scene_bytes = bytes;
      const auto limited = flatten(document, options);
      if (limited) return bytes;
      EXPECT_EQ(limited.error().exit, util::Exit::limit);
      EXPECT_NE(limited.error().message.find("--max-scene-bytes"), std::string::npos);
    }
  };
  const std::uint64_t textured_bytes = least();
  EXPECT_LT(textured_bytes, 2000u);
  EXPECT_GE(textured_bytes, flatten(document, options)->bytes());
}

TEST(SceneMaterials, TextureTransformFollowsTheExtensionsExample) {
  GltfFile file = textured();
  file.root["extensionsUsed"] = {"KHR_texture_transform"};
  auto& base = file.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
  base["extensions"]["KHR_texture_transform"] = {
      {"offset", {0, 1}}, {"rotation", M_PI / 2}, {"scale", {0.5, 0.5}}, {"texCoord", 1}};
  Decoder decoder;
  FlattenOptions options;
  options.decode = decoder.function();
  const Scene scene = file.scene(options);
  const auto& ref = scene.materials[0].base_color_texture;
  EXPECT_EQ(ref.texcoord, 1u);
  // "This example utilizes only the lower left quadrant of the source image, rotated clockwise 90
  // degrees": v points down in glTF.
  const auto moved = [&](float u, float v) {
    const kernels::Vec3 p(u, v, 1.0f);
    return kernels::Vec2(glm::dot(ref.transform_u, p), glm::dot(ref.transform_v, p));
  };
  for (const float u : {0.0f, 0.3f, 1.0f}) {
    for (const float v : {0.0f, 0.7f, 1.0f}) {
      EXPECT_NEAR(moved(u, v).x, 0.5f * v, 1e-6f);
      EXPECT_NEAR(moved(u, v).y, 1.0f - 0.5f * u, 1e-6f);
    }
  }
  // Clockwise: the image's lower left corner (0, 1) shows at the surface's upper left (0, 0).
  EXPECT_NEAR(moved(0, 0).y, 1.0f, 1e-6f);
}

TEST(SceneMaterials, ThirdSetOfTextureCoordinatesIsAWarning) {
  GltfFile file = textured();
  const int uv2 = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
  file.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_2"] = uv2;
  file.root["materials"][0]["occlusionTexture"]["texCoord"] = 2;
  file.root["materials"][0]["emissiveTexture"]["texCoord"] = 2;
  Decoder decoder;
  FlattenOptions options;
  options.decode = decoder.function();
  const Scene scene = file.scene(options);
  EXPECT_EQ(scene.materials[0].occlusion_texture.texture, kernels::kNone);
  ASSERT_EQ(scene.warnings.size(), 1u) << "each line once";
  EXPECT_NE(scene.warnings[0].find("TEXCOORD_2"), std::string::npos);
}

}  // namespace
}  // namespace octrace::scene
