// The planes that a render can fill, and the record through which kernels write them.
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

// In the order in which they are written to a file.
enum class Aov : int {
  beauty,            // 4 floats: R G B A, linear, premultiplied
  depth,             // 1: Z, planar depth along the camera's axis; +inf where nothing is hit
  distance,          // 1: Euclidean from the camera's centre (orthographic: as Z); +inf
  normal,            // 3: shading normal, world, facing the viewer; 0
  geometric_normal,  // 3: of the flat triangle, world, facing the viewer; 0
  position,          // 3: world; 0
  albedo,            // 3: linear base colour; 0
  uv,                // 2: first texture coordinate set; 0
  barycentric,       // 2: weights of the second and third corner; 0
  object_id,         // uint32: node index + 1; 0
  material_id,       // uint32: material index + 1; 0
  primitive_id,      // uint32: triangle index + 1; 0
  mask,              // 1: 1 where something is hit, else 0
  motion,            // 2: to the next frame, pixels, +x right, +y down; 0
};
inline constexpr int kAovCount = 14;

// float or uint32 values, channels interleaved, rows from the top; null: not asked for.
struct FramebufferView {
  void* planes[kAovCount] = {};
  std::uint32_t width = 0, height = 0;
  std::uint32_t first_row =
      0;  // of the image, that row 0 of the planes is: bands of a larger image

  OCTRACE_HD std::uint64_t pixel(std::uint32_t x, std::uint32_t y) const {
    return static_cast<std::uint64_t>(y - first_row) * width + x;
  }
  OCTRACE_HD float* floats(Aov aov) const {
    return static_cast<float*>(planes[static_cast<int>(aov)]);
  }
  OCTRACE_HD std::uint32_t* uints(Aov aov) const {
    return static_cast<std::uint32_t*>(planes[static_cast<int>(aov)]);
  }
};

// The same planes, but all null except these: what is written through it is known when it is
// compiled, so that a loop over pixels asks no pixel which planes there are.
template <Aov... kKept>
struct PlanesOf {
  const FramebufferView& all;

  OCTRACE_HD static constexpr bool keeps(Aov aov) { return ((aov == kKept) || ...); }
  OCTRACE_HD bool any() const { return ((all.planes[static_cast<int>(kKept)] != nullptr) || ...); }
  OCTRACE_HD std::uint64_t pixel(std::uint32_t x, std::uint32_t y) const { return all.pixel(x, y); }
  OCTRACE_HD float* floats(Aov aov) const { return keeps(aov) ? all.floats(aov) : nullptr; }
  OCTRACE_HD std::uint32_t* uints(Aov aov) const { return keeps(aov) ? all.uints(aov) : nullptr; }
};

}  // namespace octrace::kernels
