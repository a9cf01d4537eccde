// A scene and its octree as one trivially copyable record of spans, in host or device memory.
#pragma once

#include <type_traits>

#include "kernels/node.h"
#include "kernels/ray.h"
#include "kernels/scene_types.h"

namespace octrace::kernels {

struct SceneView {
  OctreeView octree;
  Span<Vec3> positions;
  Span<Triangle> triangles;
  Span<std::uint32_t> triangle_geometry;  // geometry of each triangle
  Span<Geometry> geometries;
  Span<Vec3> normals;
  Span<Vec4> tangents;  // w: handedness
  Span<Vec2> uvs;       // both sets; a geometry's uv0 and uv1 say where
  Span<Vec4> colors;    // linear
  Span<Material> materials;
  Span<Texture> textures;
  Span<std::uint32_t> texels;             // R in the low byte
  const float* srgb_to_linear = nullptr;  // 256 entries
  Span<Light> lights;
  float diagonal = 1.0f;  // of the bounds; scales ray offsets
};
static_assert(std::is_trivially_copyable_v<SceneView>);

// What a ray finds in a kind of scene.
template <class Scene>
struct HitType {
  using Type = Hit;
};
template <class Scene>
using HitOf = typename HitType<Scene>::Type;

}  // namespace octrace::kernels
