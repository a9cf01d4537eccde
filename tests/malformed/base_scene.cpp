#include "tests/malformed/base_scene.h"

#include <cstring>

namespace octrace::tests {
namespace {

template <class T>
void append(std::vector<std::uint8_t>& bytes, std::initializer_list<T> values) {
  for (const T value : values) {
    const auto* raw = reinterpret_cast<const std::uint8_t*>(&value);
    for (std::size_t i = 0; i < sizeof value; ++i) bytes.push_back(raw[i]);
  }
}

}  // namespace

std::string base64(std::span<const std::uint8_t> bytes) {
  constexpr char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? bytes[i + k] : 0);
    for (std::size_t k = 0; k < 4; ++k) {
      out += i + k > bytes.size() ? '=' : alphabet[bits >> (18 - 6 * k) & 63];
    }
  }
  return out;
}

std::string data_uri(std::span<const std::uint8_t> bytes, const std::string& mime) {
  return "data:" + mime + ";base64," + base64(bytes);
}

std::vector<std::uint8_t> tiny_png() {
  return {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
          0x44, 0x52, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x06, 0x00, 0x00,
          0x00, 0x1f, 0x15, 0xc4, 0x89, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
          0x9c, 0x63, 0xf8, 0xcf, 0xc0, 0xf0, 0x1f, 0x00, 0x05, 0x00, 0x01, 0xff, 0x89, 0x99,
          0x3d, 0x1d, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
}

std::vector<std::uint8_t> base_buffer() {
  std::vector<std::uint8_t> bytes;
  append<float>(bytes, {0, 0, 0, 1, 0, 0, 0, 1, 0});                  // 0: positions
  append<float>(bytes, {0, 0, 1, 0, 0, 1, 0, 0, 1});                  // 36: normals
  append<float>(bytes, {0, 0, 1, 0, 0, 1});                           // 72: texture coordinates
  append<std::uint8_t>(bytes, {0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0});  // 96: joints
  append<float>(bytes, {.5f, .5f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});     // 108: weights
  append<std::uint16_t>(bytes, {0, 1, 2, 0});                         // 156: indices, padding
  for (int i = 0; i < 2; ++i) {                                       // 164: bind matrices
    append<float>(bytes, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  }
  append<float>(bytes, {0, 1});              // 292: times
  append<float>(bytes, {0, 0, 0, 1, 2, 3});  // 300: translations
  append<std::uint16_t>(bytes, {0, 2});      // 324: sparse indices
  append<float>(bytes, {0, 0, 1, 0, 0, 2});  // 328: sparse values
  return bytes;                              // 352
}

nlohmann::json base_scene() {
  auto scene = nlohmann::json::parse(R"({
    "asset": {"version": "2.0", "generator": "octrace's tests"},
    "extensionsUsed": ["KHR_lights_punctual", "KHR_texture_transform", "KHR_materials_unlit",
                       "KHR_materials_emissive_strength"],
    "extensionsRequired": ["KHR_texture_transform"],
    "extensions": {"KHR_lights_punctual": {"lights": [
      {"type": "spot", "color": [1, 0.5, 0], "intensity": 10, "range": 5,
       "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]}},
    "scene": 0,
    "scenes": [{"nodes": [0, 3]}],
    "nodes": [
      {"name": "root", "children": [1, 2]},
      {"camera": 0, "translation": [0, 0, 3], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
      {"extensions": {"KHR_lights_punctual": {"light": 0}},
       "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]},
      {"mesh": 0, "skin": 0, "weights": [0.5]}
    ],
    "cameras": [{"type": "perspective",
                 "perspective": {"yfov": 0.7, "znear": 0.1, "zfar": 100, "aspectRatio": 1.5}},
                {"type": "orthographic",
                 "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 10}}],
    "meshes": [{"weights": [0], "primitives": [{
      "mode": 4, "indices": 5, "material": 0,
      "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "JOINTS_0": 3, "WEIGHTS_0": 4},
      "targets": [{"POSITION": 9}]}]}],
    "skins": [{"joints": [0, 1], "inverseBindMatrices": 6, "skeleton": 0}],
    "materials": [{
      "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0,
        "roughnessFactor": 0.5, "baseColorTexture": {"index": 0, "texCoord": 0, "extensions": {
          "KHR_texture_transform": {"offset": [0, 0.5], "rotation": 1, "scale": [2, 2]}}}},
      "normalTexture": {"index": 0, "scale": 0.5}, "occlusionTexture": {"index": 0, "strength": 1},
      "emissiveTexture": {"index": 0}, "emissiveFactor": [0, 0, 1],
      "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
      "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}},
      {"extensions": {"KHR_materials_unlit": {}}}],
    "textures": [{"source": 0, "sampler": 0}],
    "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33648}],
    "images": [{"mimeType": "image/png"}],
    "animations": [{"samplers": [{"input": 7, "output": 8, "interpolation": "LINEAR"}],
                    "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}],
    "accessors": [
      {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
       "min": [0, 0, 0], "max": [1, 1, 0]},
      {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
      {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
      {"bufferView": 3, "componentType": 5121, "count": 3, "type": "VEC4"},
      {"bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC4"},
      {"bufferView": 5, "componentType": 5123, "count": 3, "type": "SCALAR"},
      {"bufferView": 6, "componentType": 5126, "count": 2, "type": "MAT4"},
      {"bufferView": 7, "componentType": 5126, "count": 2, "type": "SCALAR",
       "min": [0], "max": [1]},
      {"bufferView": 8, "componentType": 5126, "count": 2, "type": "VEC3"},
      {"componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 2],
       "sparse": {"count": 2, "indices": {"bufferView": 9, "componentType": 5123},
                  "values": {"bufferView": 10}}}
    ],
    "bufferViews": [
      {"buffer": 0, "byteOffset": 0, "byteLength": 36, "target": 34962},
      {"buffer": 0, "byteOffset": 36, "byteLength": 36, "target": 34962},
      {"buffer": 0, "byteOffset": 72, "byteLength": 24, "target": 34962},
      {"buffer": 0, "byteOffset": 96, "byteLength": 12, "byteStride": 4, "target": 34962},
      {"buffer": 0, "byteOffset": 108, "byteLength": 48, "target": 34962},
      {"buffer": 0, "byteOffset": 156, "byteLength": 6, "target": 34963},
      {"buffer": 0, "byteOffset": 164, "byteLength": 128},
      {"buffer": 0, "byteOffset": 292, "byteLength": 8},
      {"buffer": 0, "byteOffset": 300, "byteLength": 24},
      {"buffer": 0, "byteOffset": 324, "byteLength": 4},
      {"buffer": 0, "byteOffset": 328, "byteLength": 24}
    ],
    "buffers": [{"byteLength": 352}]
  })");
  scene["buffers"][0]["uri"] = data_uri(base_buffer());
  scene["images"][0]["uri"] = data_uri(tiny_png(), "image/png");
  return scene;
}

std::vector<std::uint8_t> make_glb(const std::string& json, std::span<const std::uint8_t> bin) {
  std::vector<std::uint8_t> glb;
  const auto padded = [](std::size_t size) { return (size + 3) / 4 * 4; };
  const std::size_t total = 20 + padded(json.size()) + (bin.empty() ? 0 : 8 + padded(bin.size()));
  append<std::uint32_t>(glb, {0x46546c67, 2, static_cast<std::uint32_t>(total),
                              static_cast<std::uint32_t>(padded(json.size())), 0x4e4f534a});
  glb.insert(glb.end(), json.begin(), json.end());
  glb.resize(20 + padded(json.size()), ' ');
  if (!bin.empty()) {
    append<std::uint32_t>(glb, {static_cast<std::uint32_t>(padded(bin.size())), 0x004e4942});
    glb.insert(glb.end(), bin.begin(), bin.end());
    glb.resize(total, 0);
  }
  return glb;
}

}  // namespace octrace::tests
