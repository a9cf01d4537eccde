// Vertex attributes at a point of a triangle, interpolated by its barycentric weights.
#pragma once

#include "kernels/scene_view.h"
#include "kernels/texture.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

// A place on a triangle: everything that attributes are interpolated by.
struct SurfacePoint {
  Triangle corners;
  std::uint32_t geometry;
  float u, v;
};

// `first` is the geometry's entry in `attribute` (not kNone).
template <class T>
OCTRACE_HD inline T interpolate(const Span<T>& attribute, std::uint32_t first,
                                const Geometry& geometry, const SurfacePoint& point) {
  const std::uint64_t base = first;
  const T& a = attribute[base + (point.corners.a - geometry.first_vertex)];
  const T& b = attribute[base + (point.corners.b - geometry.first_vertex)];
  const T& c = attribute[base + (point.corners.c - geometry.first_vertex)];
  const float w = 1.0f - point.u - point.v;
  return w * a + point.u * b + point.v * c;
}

// The texture coordinates that a texture reference asks for, transformed; (0, 0) where the geometry
// does not have that set.
OCTRACE_HD inline Vec2 texture_uv(const SceneView& scene, const Geometry& geometry,
                                  const SurfacePoint& point, const TextureRef& ref) {
  const std::uint32_t first = ref.texcoord == 0 ? geometry.uv0 : geometry.uv1;
  const Vec2 uv = first == kNone ? Vec2(0.0f) : interpolate(scene.uvs, first, geometry, point);
  return transform_uv(ref, uv);
}

// White where the material has no such texture.
OCTRACE_HD inline Vec4 sample_texture(const SceneView& scene, const Geometry& geometry,
                                      const SurfacePoint& point, const TextureRef& ref) {
  if (ref.texture == kNone) return Vec4(1.0f);
  return sample_texture(scene, ref.texture, texture_uv(scene, geometry, point, ref));
}

}  // namespace octrace::kernels
