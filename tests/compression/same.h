// Whether two files show the same thing: the same arrays, or the same picture.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "backend/scene/camera.h"
#include "backend/scene/flatten.h"
#include "tests/compression/encode.h"
#include "tests/unit/render_scene.h"

namespace octrace::tests {

inline scene::Scene flattened(const gltf::Document& document) {
  scene::FlattenOptions options;
  options.decode = [](std::span<const std::uint8_t>, const std::string&,
                      const util::Limits&) -> util::Result<scene::DecodedImage> {
    return scene::DecodedImage{1, 1, {0xffffffffu}};
  };
  auto scene = scene::flatten(document, options);
  if (scene) return std::move(*scene);
  ADD_FAILURE() << scene.error().to_string();
  return {};
}

inline scene::Scene flattened(const Bytes& glb) {
  auto document = gltf::load_bytes(glb, "scene.glb", {});
  if (document) return flattened(*document);
  ADD_FAILURE() << document.error().to_string();
  return {};
}
inline scene::Scene flattened(const Parts& parts) { return flattened(parts.glb()); }

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

inline void expect_same_arrays(const scene::Scene& a, const scene::Scene& b) {
  EXPECT_TRUE(same_bits(a.positions, b.positions));
  EXPECT_TRUE(same_bits(a.normals, b.normals));
  EXPECT_TRUE(same_bits(a.tangents, b.tangents));
  EXPECT_TRUE(same_bits(a.uvs, b.uvs));
  EXPECT_TRUE(same_bits(a.colors, b.colors));
  EXPECT_TRUE(same_bits(a.triangles, b.triangles));
  EXPECT_TRUE(same_bits(a.triangle_geometry, b.triangle_geometry));
}

struct Difference {
  int pixels = 0, covered = 0;
  int masks = 0, objects = 0, materials = 0;  // pixels that differ
  int depths = 0;                             // pixels of equal ids whose depths differ by more
  double farthest = 0.0;                      // their largest difference, as a share of the depth
};

// `tolerance`: of depths, as a share of the depth.
inline Difference compare_pictures(const scene::Scene& a, const scene::Scene& b, double tolerance) {
  constexpr int kWidth = 160, kHeight = 120;
  const scene::Camera camera =
      a.cameras.empty() ? scene::frame_bounds(a.bounds, double{kWidth} / kHeight) : a.cameras[0];
  const char* aovs = "Z,mask,object_id,material_id";
  const auto first = test::render_scene(a, camera, kWidth, kHeight, {}, aovs);
  const auto second = test::render_scene(b, camera, kWidth, kHeight, {}, aovs);
  Difference found;
  found.pixels = kWidth * kHeight;
  using render::Aov;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto differs = [&](Aov aov) { return first.id(aov, x, y) != second.id(aov, x, y); };
      const bool mask = first.value(Aov::mask, x, y) != second.value(Aov::mask, x, y);
      found.masks += mask;
      found.objects += differs(Aov::object_id);
      found.materials += differs(Aov::material_id);
      if (mask || first.value(Aov::mask, x, y) == 0.0f || differs(Aov::object_id)) continue;
      ++found.covered;
      const double depth = first.value(Aov::depth, x, y);
      const double apart = std::abs(depth - double{second.value(Aov::depth, x, y)}) / depth;
      found.depths += apart > tolerance;
      found.farthest = std::max(found.farthest, apart);
    }
  }
  return found;
}

}  // namespace octrace::tests
