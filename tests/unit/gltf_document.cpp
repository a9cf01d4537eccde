// What load() hands on: extensions, images, and parts of glTF that tinygltf alone would change.
#include "backend/gltf/document.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/malformed/base_scene.h"

namespace octrace::gltf {
namespace {

using nlohmann::json;

util::Result<Document> load_json(const json& scene, const LoadOptions& options = {}) {
  const std::string text = scene.dump();
  return load_bytes({text.begin(), text.end()}, "scene.gltf", options);
}

TEST(Document, ReadsTheBaseScene) {
  const auto document = load_json(tests::base_scene());
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->read_floats(0), (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(document->read_uints(5), (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(document->read_uints(3),
            (std::vector<std::uint32_t>{0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(document->read_floats(9), (std::vector<float>{0, 0, 1, 0, 0, 0, 0, 0, 2}));
  ASSERT_EQ(document->images.size(), 1u);
  EXPECT_EQ(document->images[0].mime, "image/png");
  EXPECT_EQ(document->images[0].bytes, tests::tiny_png());
  EXPECT_EQ(document->images[0].pointer, "/images/0");
  EXPECT_TRUE(document->images[0].uri.empty());
  EXPECT_EQ(document->model.lights.size(), 1u);
  EXPECT_EQ(document->model.skins[0].joints, (std::vector<int>{0, 1}));
}

TEST(Document, SniffsContentWhateverTheName) {
  json scene = tests::base_scene();
  const std::string text = scene.dump();
  EXPECT_TRUE(load_bytes({text.begin(), text.end()}, "scene.glb", {}));
  const std::string with_mark = "\xef\xbb\xbf \n" + text;
  EXPECT_TRUE(load_bytes({with_mark.begin(), with_mark.end()}, "scene.glb", {}));
  scene["buffers"][0].erase("uri");
  EXPECT_TRUE(load_bytes(tests::make_glb(scene.dump(), tests::base_buffer()), "scene.gltf", {}));
}

// glTF allows indices without a buffer view; tinygltf refuses them.
TEST(Document, IndicesWithoutBufferView) {
  json scene = tests::base_scene();
  scene["accessors"][5].erase("bufferView");
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->model.meshes[0].primitives[0].indices, 5);
  EXPECT_EQ(document->read_uints(5), (std::vector<std::uint32_t>{0, 0, 0}));
}

TEST(Document, DropsChannelsWithoutATarget) {
  json scene = tests::base_scene();
  auto& channels = scene["animations"][0]["channels"];
  channels.insert(channels.begin(), json{{"sampler", 0}, {"target", {{"path", "pointer"}}}});
  auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  ASSERT_EQ(document->model.animations[0].channels.size(), 1u);
  EXPECT_EQ(document->model.animations[0].channels[0].target_node, 1);
  // Errors behind such a channel keep the file's own numbering.
  channels[1]["target"]["path"] = "rotation";
  document = load_json(scene);
  ASSERT_FALSE(document);
  EXPECT_EQ(document.error().pointer, "/animations/0/channels/1/sampler");
}

TEST(Document, SkinWithoutBindMatrices) {
  json scene = tests::base_scene();
  scene["skins"][0].erase("inverseBindMatrices");
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->model.skins[0].inverseBindMatrices, -1);
}

// Integers inside extensions pass through tinygltf as int.
TEST(Document, LargeIntegersInTextureTransforms) {
  json scene = tests::base_scene();
  auto& transform = scene["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]
                         ["KHR_texture_transform"];
  transform["offset"] = {5000000000, 1};
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  const auto& extensions =
      document->model.materials[0].pbrMetallicRoughness.baseColorTexture.extensions;
  const auto& offset = extensions.at("KHR_texture_transform").Get("offset");
  EXPECT_EQ(offset.Get(0).GetNumberAsDouble(), 5e9);
  EXPECT_EQ(offset.Get(1).GetNumberAsDouble(), 1.0);
}

TEST(Document, QuantisedAttributesNeedTheExtension) {
  json scene = tests::base_scene();
  scene["accessors"][1]["componentType"] = 5120;
  scene["accessors"][1]["normalized"] = true;
  EXPECT_EQ(load_json(scene).error().code, "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT");
  scene["extensionsUsed"].push_back("KHR_mesh_quantization");
  scene["extensionsRequired"].push_back("KHR_mesh_quantization");
  const auto document = load_json(scene);
  EXPECT_TRUE(document) << document.error().to_string();
}

// A texture for an extension that octrace lacks may hold anything; one that is shown may not.
TEST(Document, ImagesOfForeignExtensions) {
  json scene = tests::base_scene();
  const std::vector<std::uint8_t> ktx{0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, '\r', '\n'};
  scene["images"].push_back({{"uri", tests::data_uri(ktx, "image/ktx2")}});
  EXPECT_EQ(load_json(scene).error().code, "IMAGE_UNRECOGNIZED_FORMAT");
  scene["extensionsUsed"].push_back("KHR_texture_basisu");
  scene["textures"][0]["extensions"]["KHR_texture_basisu"]["source"] = 1;
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  ASSERT_EQ(document->images.size(), 2u);
  EXPECT_FALSE(document->images[0].bytes.empty());
  EXPECT_TRUE(document->images[1].bytes.empty());
  scene["textures"][0]["source"] = 1;
  EXPECT_EQ(load_json(scene).error().code, "IMAGE_UNRECOGNIZED_FORMAT");
}

TEST(Document, KnownMaterialExtensionsAreAcceptedWhereRequired) {
  json scene = tests::base_scene();
  for (const auto name : approximated_extensions()) {
    scene["extensionsUsed"].push_back(name);
    scene["extensionsRequired"].push_back(name);
  }
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->warnings.size(), approximated_extensions().size());
}

TEST(Document, BufferLongerThanDeclaredIsCut) {
  json scene = tests::base_scene();
  auto bytes = tests::base_buffer();
  bytes.resize(bytes.size() + 100);
  scene["buffers"][0]["uri"] = tests::data_uri(bytes);
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->model.buffers[0].data, tests::base_buffer());
}

TEST(Document, UnusedPlaceholderBuffersAreAllowed) {
  json scene = tests::base_scene();
  scene["buffers"].push_back({{"byteLength", 8}});
  const auto document = load_json(scene);
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->model.buffers.size(), 2u);
}

}  // namespace
}  // namespace octrace::gltf
