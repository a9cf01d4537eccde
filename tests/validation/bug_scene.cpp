#include "tests/validation/bug_scene.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "validation/report/png.h"

namespace octrace::validation::test {
namespace {

using nlohmann::json;

struct Buffer {
  std::string bytes;
  template <class T>
  void append(T value) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    bytes.append(raw, sizeof(T));
  }
};

constexpr int kStripSteps = 40, kRings = 16, kSegments = 24;

// Position and normal, interleaved: a wavy ribbon that faces +Z.
void append_strip(Buffer& buffer) {
  for (int i = 0; i <= kStripSteps; ++i) {
    for (const float side : {1.0f, -1.0f}) {
      const float x = -2.0f + 4.0f * float(i) / kStripSteps;
      for (const float value : {x, -1.3f + 0.35f * side, 0.3f * std::sin(3.0f * x),  //
                                0.0f, 0.0f, 1.0f}) {
        buffer.append(value);
      }
    }
  }
}

// A sphere whose radius differs in every octant, so that no mirroring or turn goes unseen.
void append_lump(Buffer& buffer) {
  for (int ring = 0; ring <= kRings; ++ring) {
    for (int segment = 0; segment <= kSegments; ++segment) {
      const double theta = std::numbers::pi * ring / kRings;
      const double phi = 2.0 * std::numbers::pi * (segment % kSegments) / kSegments;
      const double x = std::sin(theta) * std::cos(phi), y = std::cos(theta);
      const double z = -std::sin(theta) * std::sin(phi);
      const double radius = 0.55 + 0.16 * x + 0.1 * y * z - 0.12 * x * y + 0.06 * z;
      for (const double value : {x, y, z}) buffer.append(static_cast<float>(radius * value));
    }
  }
}

void append_lump_indices(Buffer& buffer) {
  const auto vertex = [](int ring, int segment) {
    return static_cast<std::uint16_t>(ring * (kSegments + 1) + segment);
  };
  for (int ring = 0; ring < kRings; ++ring) {
    for (int segment = 0; segment < kSegments; ++segment) {
      const std::uint16_t a = vertex(ring, segment), b = vertex(ring + 1, segment);
      const std::uint16_t c = vertex(ring, segment + 1), d = vertex(ring + 1, segment + 1);
      for (const std::uint16_t index : {a, b, c, b, d, c}) buffer.append(index);
    }
  }
}

}  // namespace

json bug_scene() {
  constexpr int kStripVertices = 2 * (kStripSteps + 1);
  constexpr int kLumpVertices = (kRings + 1) * (kSegments + 1);
  constexpr int kIndices = 6 * kRings * kSegments;
  Buffer buffer;
  append_strip(buffer);
  const std::size_t lump = buffer.bytes.size();
  append_lump(buffer);
  const std::size_t indices = buffer.bytes.size();
  append_lump_indices(buffer);

  // A turn by 40 degrees about a slanted axis, scaled by 1.1, 0.8 and 0.95: far from symmetric, and
  // without shear, as glTF asks of a matrix.
  const json matrix{0.863145879, 0.201353722, -0.651487429, 0,          -0.047059719, 0.778467807,
                    0.178250543, 0,           0.58625083,   -0.1329972, 0.735609753,  0,
                    -1.15,       0.6,         0.1,          1};
  return {
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0, 1, 2, 3, 4, 5, 6}}}}},
      {"nodes",
       {{{"name", "strip"}, {"mesh", 0}},
        {{"name", "turned"}, {"mesh", 1}, {"matrix", matrix}},
        {{"name", "mirrored"}, {"mesh", 1}, {"scale", {-1, 1, 1}}, {"translation", {0.4, 0.55, 0}}},
        {{"name", "instance"}, {"mesh", 1}, {"translation", {1.7, 0.3, -0.5}}},
        {{"name", "back"}, {"mesh", 0}, {"rotation", {0, 1, 0, 0}}, {"translation", {0, 2.6, 0.3}}},
        {{"name", "cut out"}, {"mesh", 2}, {"translation", {1.2, -0.4, 0.6}}},
        {{"name", "orthographic"}, {"camera", 0}, {"translation", {0.1, -0.2, 4}}}}},
      {"cameras",
       {{{"type", "orthographic"},
         {"orthographic", {{"xmag", 2.4}, {"ymag", 1.8}, {"znear", 0.01}, {"zfar", 20}}}}}},
      {"materials",
       {{{"name", "plain"}},
        {{"name", "cut out"},
         {"alphaMode", "MASK"},
         {"doubleSided", true},
         {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.3}}}}}}},
      {"meshes",
       {{{"primitives",
          {{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}, {"mode", 5}, {"material", 0}}}}},
        {{"primitives", {{{"attributes", {{"POSITION", 2}}}, {"indices", 3}, {"material", 0}}}}},
        {{"primitives", {{{"attributes", {{"POSITION", 2}}}, {"indices", 3}, {"material", 1}}}}}}},
      {"accessors",
       {{{"bufferView", 0},
         {"componentType", 5126},
         {"count", kStripVertices},
         {"type", "VEC3"},
         {"min", {-2.0, -1.65, -0.3}},
         {"max", {2.0, -0.95, 0.3}}},
        {{"bufferView", 0},
         {"byteOffset", 12},
         {"componentType", 5126},
         {"count", kStripVertices},
         {"type", "VEC3"}},
        {{"bufferView", 1},
         {"componentType", 5126},
         {"count", kLumpVertices},
         {"type", "VEC3"},
         {"min", {-0.8, -0.8, -0.8}},
         {"max", {0.8, 0.8, 0.8}}},
        {{"bufferView", 2}, {"componentType", 5123}, {"count", kIndices}, {"type", "SCALAR"}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteLength", lump}, {"byteStride", 24}, {"target", 34962}},
        {{"buffer", 0}, {"byteOffset", lump}, {"byteLength", indices - lump}, {"target", 34962}},
        {{"buffer", 0},
         {"byteOffset", indices},
         {"byteLength", buffer.bytes.size() - indices},
         {"target", 34963}}}},
      {"buffers",
       {{{"byteLength", buffer.bytes.size()},
         {"uri", "data:application/octet-stream;base64," + base64(buffer.bytes)}}}},
  };
}

scene::Camera bug_scene_camera() {
  scene::Camera camera = scene::look_at(glm::dvec3(0.8, 0.9, 5.2), glm::dvec3(0.1, -0.2, 0), 0.75);
  camera.name = "bug camera";
  camera.znear = 0.01;
  return camera;
}

}  // namespace octrace::validation::test
