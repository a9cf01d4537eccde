// The place on an instance that a ray hit. What the mesh keeps in its own space is moved to the
// world as flattening would have moved it, so that shading cannot tell the two apart: corners by
// the matrix, normals by its inverse transpose, tangents by the matrix, the front by its mirroring.
#pragma once

#include "kernels/instance.h"
#include "kernels/surface.h"

namespace octrace::kernels {

struct InstancedSurface : Surface {
  const Instance* instance;  // null: a triangle of the world's own
};

OCTRACE_HD inline const SceneView& arrays_of(const InstancedSceneView& scene,
                                             const InstancedHit& hit) {
  return hit.instance == kNone ? static_cast<const SceneView&>(scene) : scene.meshes;
}
OCTRACE_HD inline std::uint32_t object_of(const InstancedSceneView& scene,
                                          const InstancedHit& hit) {
  if (hit.instance != kNone) return scene.instances[hit.instance].object;
  return scene.geometries[scene.triangle_geometry[hit.triangle]].object;
}

OCTRACE_HD inline Vec3 direction_to_world(const Instance& instance, const Vec3& v) {
  const auto& m = instance.to_world;
  return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
          m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
          m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

OCTRACE_HD inline Vec3 world_position(const InstancedSurface& surface, const Vec3& position) {
  if (surface.instance == nullptr) return position;
  const auto& m = surface.instance->to_mesh;
  return direction_to_world(*surface.instance, position) + Vec3(m[0][3], m[1][3], m[2][3]);
}

// Unit where it has a direction.
OCTRACE_HD inline Vec3 world_normal(const InstancedSurface& surface, const Vec3& normal) {
  if (surface.instance == nullptr) return normal;
  const auto& m = surface.instance->to_mesh;
  const Vec3 moved{m[0][0] * normal.x + m[1][0] * normal.y + m[2][0] * normal.z,
                   m[0][1] * normal.x + m[1][1] * normal.y + m[2][1] * normal.z,
                   m[0][2] * normal.x + m[1][2] * normal.y + m[2][2] * normal.z};
  return normalize_or(moved, Vec3(0.0f, 1.0f, 0.0f));
}

// From corners that have been moved: a mirror turns their order over.
OCTRACE_HD inline Vec3 world_front(const InstancedSurface& surface, const Vec3& flat) {
  return surface.instance != nullptr && surface.instance->reach < 0.0f ? -flat : flat;
}

// The way through the mesh's space and back rounds by a few units in the last place of the whole
// instance's size, which a corner near the world's origin says nothing of.
OCTRACE_HD inline float world_reach(const InstancedSurface& surface, float reach) {
  return surface.instance == nullptr ? reach : greater(reach, abs_of(surface.instance->reach));
}

OCTRACE_HD inline Vec3 interpolate_normal(const SceneView& scene, const InstancedSurface& surface) {
  const Geometry& geometry = geometry_of(scene, surface);
  const SurfacePoint& point = surface.point;
  const std::uint64_t base = geometry.normals;
  const Vec3 a = scene.normals[base + (point.corners.a - geometry.first_vertex)];
  const Vec3 b = scene.normals[base + (point.corners.b - geometry.first_vertex)];
  const Vec3 c = scene.normals[base + (point.corners.c - geometry.first_vertex)];
  const float w = 1.0f - point.u - point.v;
  return w * world_normal(surface, a) + point.u * world_normal(surface, b) +
         point.v * world_normal(surface, c);
}

OCTRACE_HD inline Vec4 world_tangent(const InstancedSurface& surface, const Vec4& tangent) {
  if (surface.instance == nullptr) return tangent;
  const Vec3 along =
      normalize_or(direction_to_world(*surface.instance, Vec3(tangent.x, tangent.y, tangent.z)),
                   Vec3(1.0f, 0.0f, 0.0f));
  const bool mirrors = surface.instance->reach < 0.0f;
  return {along.x, along.y, along.z, mirrors ? -tangent.w : tangent.w};
}

OCTRACE_HD inline Vec4 interpolate_tangent(const SceneView& scene,
                                           const InstancedSurface& surface) {
  const Geometry& geometry = geometry_of(scene, surface);
  const SurfacePoint& point = surface.point;
  const std::uint64_t base = geometry.tangents;
  const Vec4 a = scene.tangents[base + (point.corners.a - geometry.first_vertex)];
  const Vec4 b = scene.tangents[base + (point.corners.b - geometry.first_vertex)];
  const Vec4 c = scene.tangents[base + (point.corners.c - geometry.first_vertex)];
  const float w = 1.0f - point.u - point.v;
  return w * world_tangent(surface, a) + point.u * world_tangent(surface, b) +
         point.v * world_tangent(surface, c);
}

OCTRACE_HD inline InstancedSurface make_surface(const InstancedSceneView& scene, const Ray& ray,
                                                const InstancedHit& hit) {
  InstancedSurface surface;
  surface.instance = hit.instance == kNone ? nullptr : &scene.instances[hit.instance];
  fill_surface(arrays_of(scene, hit), ray, hit, surface);
  return surface;
}

}  // namespace octrace::kernels
