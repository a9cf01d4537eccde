// The place that a ray hit: position, normals, and where rays that leave it start. Bit-identical on
// every device.
#pragma once

#include "kernels/attributes.h"
#include "kernels/ray.h"
#include "kernels/scene_view.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

struct Surface {
  SurfacePoint point;
  std::uint32_t triangle;
  Vec3 corner[3];
  Vec3 position;
  Vec3 geometric_normal;  // unit, of the flat triangle, facing the viewer
  Vec3 vertex_normal;     // unit, interpolated, on the geometric normal's side
  float side;             // -1 where the vertex normals had to be turned to that side, else 1
};

OCTRACE_HD inline const Geometry& geometry_of(const SceneView& scene, const Surface& surface) {
  return scene.geometries[surface.point.geometry];
}
OCTRACE_HD inline const Material& material_of(const SceneView& scene, const Surface& surface) {
  return scene.materials[geometry_of(scene, surface).material];
}

// What a scene keeps is already in the world; kernels/instance_surface.h has what moves it there.
OCTRACE_HD inline Vec3 world_position(const Surface&, const Vec3& position) { return position; }
OCTRACE_HD inline Vec3 world_normal(const Surface&, const Vec3& normal) { return normal; }
OCTRACE_HD inline Vec3 world_front(const Surface&, const Vec3& flat) { return flat; }
OCTRACE_HD inline float world_reach(const Surface&, float reach) { return reach; }
OCTRACE_HD inline Vec3 interpolate_normal(const SceneView& scene, const Surface& surface) {
  const Geometry& geometry = geometry_of(scene, surface);
  return interpolate(scene.normals, geometry.normals, geometry, surface.point);
}
OCTRACE_HD inline Vec4 interpolate_tangent(const SceneView& scene, const Surface& surface) {
  const Geometry& geometry = geometry_of(scene, surface);
  return interpolate(scene.tangents, geometry.tangents, geometry, surface.point);
}

template <class AnySurface>
OCTRACE_HD inline void fill_surface(const SceneView& scene, const Ray& ray, const Hit& hit,
                                    AnySurface& surface) {
  surface.triangle = hit.triangle;
  surface.point = {scene.triangles[hit.triangle], scene.triangle_geometry[hit.triangle], hit.u,
                   hit.v};
  const Triangle& corners = surface.point.corners;
  const Vec3 a = world_position(surface, scene.positions[corners.a]);
  const Vec3 b = world_position(surface, scene.positions[corners.b]);
  const Vec3 c = world_position(surface, scene.positions[corners.c]);
  const Vec3 ab = b - a, ac = c - a;
  surface.corner[0] = a;
  surface.corner[1] = b;
  surface.corner[2] = c;
  surface.position = a + (hit.u * ab + hit.v * ac);

  // Edges of length 1, so that the products of tiny or huge edges stay in float's range.
  const Vec3 toward = normalize_or(-ray.direction, Vec3(0.0f, 0.0f, 1.0f));
  const Vec3 flat = cross(normalize_or(ab, Vec3(0.0f)), normalize_or(ac, Vec3(0.0f)));
  const Vec3 front = normalize_or(world_front(surface, flat), toward);
  surface.geometric_normal = dot(front, ray.direction) > 0.0f ? -front : front;

  Vec3 normal = front;
  if (geometry_of(scene, surface).normals != kNone)
    normal = normalize_or(interpolate_normal(scene, surface), front);
  surface.side = dot(normal, surface.geometric_normal) < 0.0f ? -1.0f : 1.0f;
  surface.vertex_normal = surface.side * normal;
}

OCTRACE_HD inline Surface make_surface(const SceneView& scene, const Ray& ray, const Hit& hit) {
  Surface surface;
  fill_surface(scene, ray, hit, surface);
  return surface;
}
// The arrays that a hit's triangle indexes, and the object that it belongs to.
OCTRACE_HD inline const SceneView& arrays_of(const SceneView& scene, const Hit&) { return scene; }
OCTRACE_HD inline std::uint32_t object_of(const SceneView& scene, const Hit& hit) {
  return scene.geometries[scene.triangle_geometry[hit.triangle]].object;
}

// The direction of growing first texture coordinate, and whether the image is mirrored, from one
// triangle's texture coordinates: what a normal texture needs where the mesh has no tangents.
OCTRACE_HD inline Vec4 triangle_tangent(const SceneView& scene, const Surface& surface,
                                        const TextureRef& ref, Vec3 normal) {
  const Geometry& geometry = geometry_of(scene, surface);
  SurfacePoint corner = surface.point;
  corner.u = corner.v = 0.0f;
  const Vec2 a = texture_uv(scene, geometry, corner, ref);
  corner.u = 1.0f;
  const Vec2 ab = texture_uv(scene, geometry, corner, ref) - a;
  corner.u = 0.0f;
  corner.v = 1.0f;
  const Vec2 ac = texture_uv(scene, geometry, corner, ref) - a;
  const Vec3 p = surface.corner[1] - surface.corner[0], q = surface.corner[2] - surface.corner[0];
  const float area = ab.x * ac.y - ab.y * ac.x;
  const float sign = area < 0.0f ? -1.0f : 1.0f;
  const Vec3 along_u = sign * (ac.y * p - ab.y * q);
  const Vec3 along_v = sign * (ab.x * q - ac.x * p);
  // Green points up the image, and glTF's second coordinate down.
  const float handedness = dot(cross(normal, along_u), along_v) > 0.0f ? -1.0f : 1.0f;
  return {along_u, handedness};
}

// The normal that shading uses: the interpolated one, moved by the normal texture. It lies on the
// geometric normal's side as long as the texture does not bend it below the surface.
template <class AnySurface>
OCTRACE_HD inline Vec3 shading_normal(const SceneView& scene, const AnySurface& surface) {
  const Material& material = material_of(scene, surface);
  const TextureRef& ref = material.normal_texture;
  if (ref.texture == kNone) return surface.vertex_normal;
  const Geometry& geometry = geometry_of(scene, surface);
  const Vec3 normal = surface.side * surface.vertex_normal;
  const Vec4 tangent = geometry.tangents != kNone ? interpolate_tangent(scene, surface)
                                                  : triangle_tangent(scene, surface, ref, normal);
  const Vec3 along = Vec3(tangent.x, tangent.y, tangent.z);
  const Vec3 t = normalize_or(along - dot(along, normal) * normal, Vec3(0.0f));
  const Vec3 b = (tangent.w < 0.0f ? -1.0f : 1.0f) * cross(normal, t);
  const Vec4 texel = sample_texture(scene, geometry, surface.point, ref);
  const float x = (texel.x * 2.0f - 1.0f) * material.normal_scale;
  const float y = (texel.y * 2.0f - 1.0f) * material.normal_scale;
  const float z = texel.z * 2.0f - 1.0f;
  return normalize_or(surface.side * (x * t + y * b + z * normal), surface.vertex_normal);
}

// Base colour, linear: factor * texture * vertex colour.
OCTRACE_HD inline Vec4 base_color(const SceneView& scene, const Surface& surface) {
  const Geometry& geometry = geometry_of(scene, surface);
  const Material& material = material_of(scene, surface);
  Vec4 color = material.base_color;
  if (material.base_color_texture.texture != kNone)
    color *= sample_texture(scene, geometry, surface.point, material.base_color_texture);
  if (geometry.colors != kNone)
    color *= interpolate(scene.colors, geometry.colors, geometry, surface.point);
  return color;
}

// Where shadow and sky rays start: on the smooth surface that the vertex normals describe where
// that bulges out of the flat triangle (Hanika 2021, "Hacking the shadow terminator", Ray Tracing
// Gems II, ch. 4), so that coarse meshes do not show their facets where light grazes them; and
// clear of the triangle itself. The position is off by a few units in the last place of the largest
// coordinate that went into it (2^-24 each), so 2^-20 of that clears it at any distance from the
// origin.
template <class AnySurface>
OCTRACE_HD inline Vec3 ray_origin(const SceneView& scene, const AnySurface& surface) {
  const float corners_reach =
      greater(greater(largest_magnitude(surface.corner[0]), largest_magnitude(surface.corner[1])),
              largest_magnitude(surface.corner[2]));
  const float reach = world_reach(surface, corners_reach);
  const Vec3 clear = surface.position + (0x1p-20f * reach) * surface.geometric_normal;
  const Geometry& geometry = geometry_of(scene, surface);
  if (geometry.normals == kNone) return clear;
  const Triangle& corners = surface.point.corners;
  const std::uint32_t index[3] = {corners.a, corners.b, corners.c};
  const float weight[3] = {1.0f - surface.point.u - surface.point.v, surface.point.u,
                           surface.point.v};
  Vec3 bulge(0.0f);
  for (int i = 0; i < 3; ++i) {
    const std::uint64_t entry =
        static_cast<std::uint64_t>(geometry.normals) + (index[i] - geometry.first_vertex);
    const Vec3 n = surface.side *
                   normalize_or(world_normal(surface, scene.normals[entry]), surface.vertex_normal);
    const float below = lesser(dot(surface.position - surface.corner[i], n), 0.0f);
    bulge -= (weight[i] * below) * n;
  }
  return clear + bulge;
}

}  // namespace octrace::kernels
