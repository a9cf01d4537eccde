// The real files of the shared folder, with what they should flatten to read from their JSON here.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>

#include "backend/scene/scene_info.h"
#include "tests/unit/scene_support.h"

namespace octrace::scene {
namespace {

using testing::expect_valid;
using testing::json;

json read_json(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(stream), {});
  if (path.extension() == ".glb") {
    std::uint32_t length = 0;
    std::memcpy(&length, text.data() + 12, 4);
    text = text.substr(20, length);
  }
  return json::parse(text);
}

struct Expected {
  std::uint64_t triangles = 0, vertices = 0, cameras = 0, lights = 0;
};

Expected expected_of(const json& file) {
  Expected expected;
  const std::function<void(int)> visit = [&](int index) {
    const json& node = file["nodes"][index];
    for (const auto& child : node.value("children", json::array())) visit(child);
    expected.cameras += node.contains("camera");
    expected.lights +=
        node.contains("extensions") && node["extensions"].contains("KHR_lights_punctual");
    if (!node.contains("mesh")) return;
    for (const auto& primitive : file["meshes"][node["mesh"].get<int>()]["primitives"]) {
      const int mode = primitive.value("mode", 4);
      if (mode < 4) continue;
      const std::uint64_t vertices =
          file["accessors"][primitive["attributes"]["POSITION"].get<int>()]["count"];
      std::uint64_t corners = vertices;
      if (primitive.contains("indices")) {
        corners = file["accessors"][primitive["indices"].get<int>()]["count"];
      }
      expected.triangles += mode == 4 ? corners / 3 : corners - 2;
      expected.vertices += vertices;
    }
  };
  for (const auto& root : file["scenes"][file.value("scene", 0)]["nodes"]) visit(root);
  return expected;
}

class SceneFiles : public ::testing::TestWithParam<std::string> {};

TEST_P(SceneFiles, FlattenToWhatTheirJsonSays) {
  const std::filesystem::path path = GetParam();
  const auto document = gltf::load(path, {});
  ASSERT_TRUE(document) << document.error().to_string();
  FlattenOptions options;
  options.decode = [](std::span<const std::uint8_t>, const std::string&, const util::Limits&) {
    return util::Result<DecodedImage>(DecodedImage{1, 1, {0xffffffffu}});
  };
  const auto scene = flatten(*document, options);
  ASSERT_TRUE(scene) << scene.error().to_string();
  expect_valid(*scene);
  const json file = read_json(path);
  const Expected expected = expected_of(file);
  EXPECT_EQ(scene->triangles.size(), expected.triangles);
  EXPECT_EQ(scene->positions.size(), expected.vertices);
  EXPECT_EQ(scene->cameras.size(), expected.cameras);
  EXPECT_EQ(scene->lights.size(), expected.lights);
  EXPECT_EQ(scene->object_names.size(), file["nodes"].size());
  EXPECT_FALSE(scene->bounds.empty);

  const SceneInfo info = collect_info(*document, *scene);
  EXPECT_EQ(info.triangles, expected.triangles);
  EXPECT_EQ(info.meshes.size(), file["meshes"].size());
  EXPECT_EQ(info.materials.size(), file.value("materials", json::array()).size());
  EXPECT_EQ(info.animations.size(), file.value("animations", json::array()).size());
  EXPECT_EQ(info.skins.size(), file.value("skins", json::array()).size());
  EXPECT_EQ(info.images.size(), file.value("images", json::array()).size());
  EXPECT_EQ(info.extensions.size(), file.value("extensionsUsed", json::array()).size());
}

std::vector<std::string> files() {
  std::vector<std::string> paths;
  for (const char* folder : {"valid", "bench"}) {
    const std::filesystem::path root = std::filesystem::path(OCTRACE_SHARED_SCENES) / folder;
    if (!std::filesystem::exists(root)) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
      const auto extension = entry.path().extension();
      if (extension == ".gltf" || extension == ".glb") paths.push_back(entry.path());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SceneFiles);
INSTANTIATE_TEST_SUITE_P(Shared, SceneFiles, ::testing::ValuesIn(files()), [](const auto& test) {
  std::string name = std::filesystem::path(test.param).stem();
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
});

TEST(SceneFilesFolder, AreThere) {
  if (files().empty()) GTEST_SKIP() << "no shared scenes at " << OCTRACE_SHARED_SCENES;
  EXPECT_GE(files().size(), 30u);
}

}  // namespace
}  // namespace octrace::scene
