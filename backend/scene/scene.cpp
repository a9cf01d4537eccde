#include "backend/scene/scene.h"

#include <array>
#include <cmath>

#include "backend/scene/instances.h"

namespace octrace::scene {

namespace {

// IEC 61966-2-1. Filled at first use; 256 entries cost less than a texture's row.
std::array<float, 256> make_srgb_table() {
  std::array<float, 256> table{};
  for (int i = 0; i < 256; ++i) {
    const double encoded = i / 255.0;
    table[i] = static_cast<float>(encoded <= 0.04045 ? encoded / 12.92
                                                     : std::pow((encoded + 0.055) / 1.055, 2.4));
  }
  return table;
}

template <class T>
kernels::Span<T> span_of(const std::vector<T>& values) {
  return {values.data(), values.size()};
}

template <class T>
std::uint64_t bytes_of(const std::vector<T>& values) {
  return values.size() * sizeof(T);
}

float diagonal_of(const Bounds& bounds) {
  if (bounds.empty) return 1.0f;
  const double x = double(bounds.upper.x) - bounds.lower.x;
  const double y = double(bounds.upper.y) - bounds.lower.y;
  const double z = double(bounds.upper.z) - bounds.lower.z;
  const auto diagonal = static_cast<float>(std::sqrt(x * x + y * y + z * z));
  return diagonal > 0.0f ? diagonal : 1.0f;
}

}  // namespace

kernels::SceneView Scene::view() const {
  static const std::array<float, 256> srgb = make_srgb_table();
  kernels::SceneView view;
  view.positions = span_of(positions);
  view.triangles = span_of(triangles);
  view.triangle_geometry = span_of(triangle_geometry);
  view.geometries = span_of(geometries);
  view.normals = span_of(normals);
  view.tangents = span_of(tangents);
  view.uvs = span_of(uvs);
  view.colors = span_of(colors);
  view.materials = span_of(materials);
  view.textures = span_of(textures);
  view.texels = span_of(texels);
  view.srgb_to_linear = srgb.data();
  view.lights = span_of(lights);
  view.diagonal = diagonal_of(bounds);
  return view;
}

std::uint64_t Scene::bytes() const {
  return bytes_of(positions) + bytes_of(triangles) + bytes_of(triangle_geometry) +
         bytes_of(geometries) + bytes_of(normals) + bytes_of(tangents) + bytes_of(uvs) +
         bytes_of(colors) + bytes_of(materials) + bytes_of(textures) + bytes_of(texels) +
         bytes_of(lights) + (instancing ? instancing->bytes() : 0);
}

Bounds bounds_of(const std::vector<kernels::Vec3>& positions) {
  Bounds bounds;
  if (positions.empty()) return bounds;
  bounds.lower = bounds.upper = positions.front();
  for (const kernels::Vec3& p : positions) {
    bounds.lower = glm::min(bounds.lower, p);
    bounds.upper = glm::max(bounds.upper, p);
  }
  bounds.empty = false;
  return bounds;
}

}  // namespace octrace::scene
