#include "backend/scene/triangulate.h"

#include "backend/gltf/tinygltf.h"

namespace octrace::scene {

bool has_triangles(int mode) {
  return mode == TINYGLTF_MODE_TRIANGLES || mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
         mode == TINYGLTF_MODE_TRIANGLE_FAN;
}

std::uint64_t triangle_count(int mode, std::uint64_t count) {
  if (!has_triangles(mode)) return 0;
  if (mode == TINYGLTF_MODE_TRIANGLES) return count / 3;
  return count < 3 ? 0 : count - 2;
}

std::vector<kernels::Triangle> triangulate(int mode, std::span<const std::uint32_t> indices,
                                           std::uint32_t vertices) {
  const std::uint64_t count =
      triangle_count(mode, indices.empty() ? std::uint64_t{vertices} : indices.size());
  const auto index = [&](std::uint64_t i) {
    return indices.empty() ? static_cast<std::uint32_t>(i) : indices[i];
  };
  std::vector<kernels::Triangle> triangles;
  triangles.reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLES) {
      triangles.push_back({index(3 * i), index(3 * i + 1), index(3 * i + 2)});
    } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      triangles.push_back({index(i), index(i + 1 + i % 2), index(i + 2 - i % 2)});
    } else {
      triangles.push_back({index(i + 1), index(i + 2), index(0)});
    }
  }
  return triangles;
}

}  // namespace octrace::scene
