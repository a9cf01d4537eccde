// A flattened scene: flat arrays in world space, ready for an octree and for upload to a device.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backend/scene/camera.h"
#include "kernels/scene_types.h"
#include "kernels/scene_view.h"

namespace octrace::scene {

struct Instancing;  // instances.h

struct Bounds {
  kernels::Vec3 lower{0.0f};
  kernels::Vec3 upper{0.0f};
  bool empty = true;
};

// The arrays have the layout of kernels::SceneView, whose comments say what they hold. Invariants:
// every index is in range, every position is finite and within +-kMaxCoordinate, materials is never
// empty (its last entry is glTF's default material where a primitive names none).
struct Scene {
  std::vector<kernels::Vec3> positions;
  std::vector<kernels::Triangle> triangles;
  std::vector<std::uint32_t> triangle_geometry;
  std::vector<kernels::Geometry> geometries;
  std::vector<kernels::Vec3> normals;
  std::vector<kernels::Vec4> tangents;
  std::vector<kernels::Vec2> uvs;
  std::vector<kernels::Vec4> colors;
  std::vector<kernels::Material> materials;
  std::vector<kernels::Texture> textures;
  std::vector<std::uint32_t> texels;
  std::vector<kernels::Light> lights;

  // Meshes that are shown many times, beside the arrays above, which hold nothing of them; null:
  // none. What knows no instances takes bake_instances() of the scene.
  std::shared_ptr<const Instancing> instancing;

  std::vector<Camera> cameras;              // placed in the world, in node order
  std::vector<std::string> object_names;    // by object index: glTF nodes, then instances
  std::vector<std::string> object_meshes;   // by object index; empty: the object has no mesh
  std::vector<std::string> material_names;  // by material index
  Bounds bounds;
  std::vector<std::string> warnings;  // one line each, no duplicates

  // Host view; octree is left empty for the caller to fill. Valid while the scene is unchanged.
  kernels::SceneView view() const;
  std::uint64_t bytes() const;
};

Bounds bounds_of(const std::vector<kernels::Vec3>& positions);

// Beyond this the triangle test's products leave the range of float.
inline constexpr float kMaxCoordinate = 1e9f;

}  // namespace octrace::scene
