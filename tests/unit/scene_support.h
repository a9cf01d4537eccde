// What the tests of scenes share: glTF files made in place, and the invariants of every scene.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/flatten.h"
#include "backend/scene/scene.h"

namespace octrace::scene::testing {

using nlohmann::json;

inline std::string base64(const std::string& bytes) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k <= bytes.size() ? digits[group >> (18 - 6 * k) & 63] : '=';
    }
  }
  return text;
}

// A glTF file under construction: `root` is its JSON, accessors are appended to one buffer.
class GltfFile {
 public:
  GltfFile() { root = {{"asset", {{"version", "2.0"}}}, {"scene", 0}}; }

  int floats(const char* type, const std::vector<float>& values) {
    const int components = components_of(type);
    json accessor = {
        {"componentType", 5126}, {"type", type}, {"count", values.size() / components}};
    if (std::string(type) == "VEC3" || std::string(type) == "SCALAR") {
      json least = json::array(), most = json::array();
      for (int c = 0; c < components; ++c) {
        float low = values[c], high = values[c];
        for (std::size_t i = c; i < values.size(); i += components) {
          low = std::min(low, values[i]);
          high = std::max(high, values[i]);
        }
        least.push_back(low);
        most.push_back(high);
      }
      accessor["min"] = least;
      accessor["max"] = most;
    }
    return add(std::move(accessor), values.data(), values.size() * sizeof(float));
  }
  int uint16s(const char* type, const std::vector<std::uint16_t>& values) {
    return add(
        {{"componentType", 5123}, {"type", type}, {"count", values.size() / components_of(type)}},
        values.data(), values.size() * sizeof(std::uint16_t));
  }

  // The JSON array's next index after appending.
  int append(const char* array, json value) {
    root[array].push_back(std::move(value));
    return static_cast<int>(root[array].size()) - 1;
  }

  // A mesh of one primitive.
  int mesh(const std::vector<float>& positions, int mode = 4, json more = json::object()) {
    json primitive = {{"attributes", {{"POSITION", floats("VEC3", positions)}}}, {"mode", mode}};
    primitive.merge_patch(more);
    return append("meshes", {{"primitives", json::array({primitive})}});
  }

  // The whole file, its buffer within.
  std::string text() const {
    json file = root;
    if (!bytes_.empty()) {
      file["buffers"] =
          json::array({{{"byteLength", bytes_.size()},
                        {"uri", "data:application/octet-stream;base64," + base64(bytes_)}}});
    }
    return file.dump(1);
  }

  util::Result<gltf::Document> load() const {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test->test_suite_name()) + "_" + test->name();
    std::replace(name.begin(), name.end(), '/', '_');  // of a test with parameters
    const std::string path = ::testing::TempDir() + "octrace_" + name + ".gltf";
    std::ofstream(path) << text();
    auto document = gltf::load(path, {});
    std::filesystem::remove(path);
    return document;
  }

  // Fails the test where the file is refused.
  gltf::Document document() const {
    auto loaded = load();
    if (!loaded) {
      ADD_FAILURE() << loaded.error().to_string();
      return {};
    }
    return std::move(*loaded);
  }

  Scene scene(const FlattenOptions& options = {}) const {
    auto flat = flatten(document(), options);
    if (!flat) {
      ADD_FAILURE() << flat.error().to_string();
      return {};
    }
    return std::move(*flat);
  }

  json root;

 private:
  static int components_of(const std::string& type) {
    return type == "SCALAR" ? 1 : type == "VEC2" ? 2 : type == "VEC3" ? 3 : type == "VEC4" ? 4 : 16;
  }
  int add(json accessor, const void* data, std::size_t size) {
    while (bytes_.size() % 4 != 0) bytes_ += '\0';
    accessor["bufferView"] =
        append("bufferViews", {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}});
    bytes_.append(static_cast<const char*>(data), size);
    return append("accessors", std::move(accessor));
  }
  std::string bytes_;
};

inline glm::dvec3 position(const Scene& scene, std::uint32_t index) {
  return glm::dvec3(scene.positions[index]);
}

// Everything that scene.h promises of a scene, and that every reference is in range.
inline void expect_valid(const Scene& scene) {
  ASSERT_EQ(scene.triangles.size(), scene.triangle_geometry.size());
  ASSERT_FALSE(scene.materials.empty());
  ASSERT_EQ(scene.materials.size(), scene.material_names.size());
  for (const auto& p : scene.positions) {
    ASSERT_TRUE(std::abs(p.x) <= kMaxCoordinate && std::abs(p.y) <= kMaxCoordinate &&
                std::abs(p.z) <= kMaxCoordinate);
  }
  std::uint32_t next_triangle = 0;
  for (std::size_t g = 0; g < scene.geometries.size(); ++g) {
    const auto& geometry = scene.geometries[g];
    ASSERT_EQ(geometry.first_triangle, next_triangle);
    next_triangle += geometry.triangle_count;
    ASSERT_LE(std::uint64_t{geometry.first_vertex} + geometry.vertex_count, scene.positions.size());
    ASSERT_LT(geometry.material, scene.materials.size());
    ASSERT_LT(geometry.object, scene.object_names.size());
    const auto fits = [&](std::uint32_t first, std::size_t size) {
      return first == kernels::kNone || std::uint64_t{first} + geometry.vertex_count <= size;
    };
    ASSERT_TRUE(fits(geometry.normals, scene.normals.size()));
    ASSERT_TRUE(fits(geometry.tangents, scene.tangents.size()));
    ASSERT_TRUE(fits(geometry.uv0, scene.uvs.size()));
    ASSERT_TRUE(fits(geometry.uv1, scene.uvs.size()));
    ASSERT_TRUE(fits(geometry.colors, scene.colors.size()));
    for (std::uint32_t t = 0; t < geometry.triangle_count; ++t) {
      ASSERT_EQ(scene.triangle_geometry[geometry.first_triangle + t], g);
      const auto& triangle = scene.triangles[geometry.first_triangle + t];
      for (const std::uint32_t corner : {triangle.a, triangle.b, triangle.c}) {
        ASSERT_GE(corner, geometry.first_vertex);
        ASSERT_LT(corner, geometry.first_vertex + geometry.vertex_count);
      }
    }
  }
  ASSERT_EQ(next_triangle, scene.triangles.size());
  for (const auto& normal : scene.normals) ASSERT_NEAR(glm::length(normal), 1.0f, 1e-5f);
  for (const auto& texture : scene.textures) {
    ASSERT_GT(texture.width * texture.height, 0u);
    ASSERT_LE(texture.first_texel + std::uint64_t{texture.width} * texture.height,
              scene.texels.size());
  }
  for (const auto& material : scene.materials) {
    for (const auto* ref :
         {&material.base_color_texture, &material.metallic_roughness_texture,
          &material.normal_texture, &material.occlusion_texture, &material.emissive_texture}) {
      ASSERT_TRUE(ref->texture == kernels::kNone || ref->texture < scene.textures.size());
      ASSERT_LE(ref->texcoord, 1u);
    }
  }
}

}  // namespace octrace::scene::testing
