// KHR_materials_variants, KHR_node_visibility and EXT_texture_webp as the scene follows them.
#include <gtest/gtest.h>

#include "backend/scene/animator.h"
#include "backend/scene/scene_info.h"
#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::expect_valid;
using testing::GltfFile;
using testing::json;

// A mesh of two primitives, of materials 0 and none; "night" gives both another, "rain" the second.
GltfFile with_variants() {
  GltfFile file;
  file.root["extensionsUsed"] = {"KHR_materials_variants"};
  file.root["extensions"]["KHR_materials_variants"]["variants"] = {
      {{"name", "day"}}, {{"name", "night"}}, {{"name", "rain"}}, {{"name", "1"}}};
  for (const char* name : {"paint", "dark", "wet"}) file.append("materials", {{"name", name}});
  file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4, {{"material", 0}});
  json& primitives = file.root["meshes"][0]["primitives"];
  primitives.push_back({{"attributes", primitives[0]["attributes"]}});
  const auto map = [&](int primitive, json mappings) {
    primitives[primitive]["extensions"]["KHR_materials_variants"]["mappings"] = mappings;
  };
  map(0, {{{"material", 1}, {"variants", {1, 3}}}, {{"material", 0}, {"variants", {0}}}});
  map(1, {{{"material", 2}, {"variants", {2}}}, {{"material", 1}, {"variants", {1}}}});
  file.append("nodes", {{"mesh", 0}});
  file.append("scenes", {{"nodes", {0}}});
  return file;
}

std::vector<std::string> materials_of(const GltfFile& file, const std::string& variant) {
  FlattenOptions options;
  options.variant = variant;
  const Scene scene = file.scene(options);
  expect_valid(scene);
  std::vector<std::string> names;
  for (const auto& geometry : scene.geometries) {
    names.push_back(scene.material_names[geometry.material]);
  }
  return names;
}

using Names = std::vector<std::string>;

TEST(Variants, ChooseMaterials) {
  const GltfFile file = with_variants();
  EXPECT_EQ(materials_of(file, ""), (Names{"paint", "default"}));
  EXPECT_EQ(materials_of(file, "day"), (Names{"paint", "default"}));
  EXPECT_EQ(materials_of(file, "night"), (Names{"dark", "dark"}));
  EXPECT_EQ(materials_of(file, "rain"), (Names{"paint", "wet"}));
  EXPECT_EQ(materials_of(file, "2"), (Names{"paint", "wet"}));
  // A name goes before an index: "1" is what variant 3 is called.
  EXPECT_EQ(materials_of(file, "1"), (Names{"dark", "default"}));
}

TEST(Variants, UnknownOnesAreUsageErrors) {
  FlattenOptions options;
  for (const char* variant : {"dusk", "4", "-1", "0x1", " 1"}) {
    options.variant = variant;
    const auto scene = flatten(with_variants().document(), options);
    ASSERT_FALSE(scene) << variant;
    EXPECT_EQ(scene.error().exit, util::Exit::usage);
    EXPECT_NE(scene.error().message.find("\"night\""), std::string::npos) << scene.error().message;
  }
  GltfFile plain;
  plain.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0});
  plain.append("scenes", json::object());
  options.variant = "night";
  const auto scene = flatten(plain.document(), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().exit, util::Exit::usage);
}

// The shader takes a material's word that its texture coordinates are there.
TEST(Variants, NeedTheirMaterialsTextureCoordinates) {
  GltfFile file = with_variants();
  file.append("images", {{"uri", "data:,"}});
  file.append("textures", {{"source", 0}});
  file.root["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 0;
  const auto document = file.load();
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().code, "MESH_PRIMITIVE_TOO_FEW_TEXCOORDS");
  EXPECT_EQ(document.error().pointer,
            "/meshes/0/primitives/1/extensions/KHR_materials_variants/mappings/0/material");
}

TEST(Variants, AreDescribed) {
  const gltf::Document document = with_variants().document();
  const SceneInfo info = collect_info(document, *flatten(document, {}));
  ASSERT_EQ(info.variants.size(), 4u);
  EXPECT_EQ(info.variants[1].name, "night");
  EXPECT_EQ(info.variants[0].primitives, 0u);  // mapped to the material it has anyway
  EXPECT_EQ(info.variants[1].primitives, 2u);
  EXPECT_EQ(info.variants[2].primitives, 1u);
}

// 0 (mesh) has 1 (mesh, hidden) and 4 (mesh); below 1: 2 (mesh, says it is visible, with a light)
// and 3 (a camera). 4 moves.
GltfFile with_hidden() {
  GltfFile file;
  file.root["extensionsUsed"] = {"KHR_node_visibility", "KHR_lights_punctual"};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.append("cameras",
              {{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}});
  file.append("nodes", {{"mesh", 0}, {"children", {1, 4}}});
  file.append("nodes", {{"mesh", 0},
                        {"children", {2, 3}},
                        {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  file.append(
      "nodes",
      {{"mesh", 0},
       {"extensions",
        {{"KHR_node_visibility", {{"visible", true}}}, {"KHR_lights_punctual", {{"light", 0}}}}}});
  file.append("nodes", {{"camera", 0}});
  file.append("nodes", {{"mesh", 0}, {"extensions", {{"KHR_node_visibility", json::object()}}}});
  file.append("scenes", {{"nodes", {0}}});
  return file;
}

std::vector<std::uint32_t> objects_of(const Scene& scene) {
  std::vector<std::uint32_t> objects;
  for (const auto& geometry : scene.geometries) objects.push_back(geometry.object);
  return objects;
}

TEST(Visibility, HidesMeshesAndLightsBelowButNoCamera) {
  GltfFile file = with_hidden();
  const Scene scene = file.scene();
  expect_valid(scene);
  EXPECT_EQ(objects_of(scene), (std::vector<std::uint32_t>{0, 4}));  // ids stay the nodes' own
  EXPECT_TRUE(scene.lights.empty());
  EXPECT_EQ(scene.cameras.size(), 1u);
  EXPECT_EQ(scene.object_names.size(), 5u);
  const gltf::Document document = file.document();
  EXPECT_EQ(collect_info(document, scene).hidden_nodes, 3u);

  file.root["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = true;
  const Scene shown = file.scene();
  EXPECT_EQ(objects_of(shown), (std::vector<std::uint32_t>{0, 1, 2, 4}));
  EXPECT_EQ(shown.lights.size(), 1u);
}

TEST(Visibility, HiddenLightsStayHiddenInTime) {
  GltfFile file = with_hidden();
  const int times = file.floats("SCALAR", {0, 1});
  const int places = file.floats("VEC3", {0, 0, 0, 5, 0, 0});
  file.append(
      "animations",
      {{"samplers", {{{"input", times}, {"output", places}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}});
  Scene scene;
  auto animator = Animator::open(file.document(), {}, "", 0.0, scene);
  ASSERT_TRUE(animator) << animator.error().to_string();
  ASSERT_TRUE((*animator)->moves());
  ASSERT_TRUE((*animator)->move_to(0.5, scene));
  EXPECT_TRUE(scene.lights.empty());
  EXPECT_EQ(objects_of(scene), (std::vector<std::uint32_t>{0, 4}));
  EXPECT_EQ(scene.positions[0].x, 2.5f);
}

// Of 3 x 5 pixels, lossless; its header is all that is looked at here.
constexpr std::uint8_t kWebp[] = {'R', 'I', 'F', 'F', 18, 0, 0, 0,    'W', 'E', 'B', 'P', 'V',
                                  'P', '8', 'L', 5,   0,  0, 0, 0x2f, 2,   0,   1,   0,   0};

TEST(TextureWebp, GoesBeforeItsFallback) {
  const std::string webp(reinterpret_cast<const char*>(kWebp), sizeof kWebp);
  for (const bool fallback : {true, false}) {
    GltfFile file;
    file.root["extensionsUsed"] = {"EXT_texture_webp"};
    const int uv = file.floats("VEC2", {0, 0, 1, 0, 0, 1});
    file.mesh({0, 0, 0, 1, 0, 0, 0, 1, 0}, 4,
              {{"attributes", {{"TEXCOORD_0", uv}}}, {"material", 0}});
    file.append("nodes", {{"mesh", 0}});
    file.append("scenes", {{"nodes", {0}}});
    file.append("images", {{"uri", "data:image/webp;base64," + testing::base64(webp)}});
    file.append("textures", {{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}});
    if (fallback) {
      // 1 x 1 and of another format, for those who do not read WebP.
      file.append("images",
                  {{"uri",
                    "data:image/png;base64,"
                    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGP4z8DwHwAFAAH"
                    "/iZk9HQAAAABJRU5ErkJggg=="}});
      file.root["textures"][0]["source"] = 1;
    } else {
      file.root["extensionsRequired"] = {"EXT_texture_webp"};
    }
    file.append("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
    std::vector<std::string> decoded;
    FlattenOptions options;
    options.decode = [&](std::span<const std::uint8_t> bytes, const std::string& mime,
                         const util::Limits&) -> util::Result<DecodedImage> {
      decoded.push_back(mime);
      EXPECT_EQ(bytes.size(), sizeof kWebp);
      return DecodedImage{3, 5, std::vector<std::uint32_t>(15, 7)};
    };
    const Scene scene = file.scene(options);
    EXPECT_EQ(decoded, (Names{"image/webp"}));
    ASSERT_EQ(scene.textures.size(), 1u);
    EXPECT_EQ(scene.textures[0].width, 3u);
    EXPECT_EQ(scene.textures[0].height, 5u);
  }
}

}  // namespace
}  // namespace octrace::scene
