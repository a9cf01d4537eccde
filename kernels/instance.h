// Instances: meshes that are kept once, in a space of their own, and shown many times. A top octree
// over the instances' boxes leads to a walk through the mesh's own octree, with the ray moved into
// the mesh's space.
//
// The same bits for every builder and device, by the argument of box.h once more: a hit of an
// instance counts only where its t lies in slab(the instance's box, the ray), and the boxes of all
// nodes above hold that box, so the walk reaches whatever a test of every instance would find.
//
// Nothing is lost by that condition, because the box is wide enough (place_instances.cpp) for all
// roundings that grow with the instance's size, and slab() for those that grow with its distance:
// with D the largest distance along an axis from the ray's origin to the box and u = 2^-24, moving
// the origin next to the instance rounds by 2 u D and adding up t by u D, and slab() leaves
// 11 u D between the box's own planes and its interval.
#pragma once

#include "kernels/scene_view.h"
#include "kernels/traverse.h"
#include "kernels/triangle.h"

namespace octrace::kernels {

// Of the mesh's space: its bounds are centred on 0 and reach as far as 1/2 to 1 along the longest
// axis, so that no scale of a file is too small or too large for it.
struct alignas(16) Instance {
  float to_mesh[3][4];   // rows of the inverse of to_world; [r][3]: the mesh's centre in the world
  float to_world[3][3];  // rows
  std::uint32_t mesh;    // index into InstancedSceneView::roots
  std::uint32_t object;  // what object_id - 1 becomes
  float reach;           // metres: the largest half extent of its box; negative where it mirrors
};
static_assert(sizeof(Instance) == 96);

// Where a mesh's octree lies in InstancedSceneView::meshes.octree; indices inside it count from
// there.
struct MeshRoot {
  std::uint32_t first_node, node_count, first_triangle, triangle_count;
};

// A scene with instances: what the nodes show directly in the world, as in any other scene, and
// beside it the meshes and the top octree. The top octree's triangles are boxes: a and b their
// corners, `triangle` the instance, `geometry` its mesh.
struct InstancedSceneView : SceneView {
  SceneView meshes;  // in their own spaces; materials, textures and lights are the world's
  OctreeView top;
  Span<MeshRoot> roots;
  Span<Instance> instances;
};
static_assert(std::is_trivially_copyable_v<InstancedSceneView>);

// instance: kNone where the triangle is one of the world's own.
struct InstancedHit : Hit {
  std::uint32_t instance;
};
template <>
struct HitType<InstancedSceneView> {
  using Type = InstancedHit;
};

OCTRACE_HD OCTRACE_FORCE_INLINE OctreeView octree_of(const InstancedSceneView& scene,
                                                     std::uint32_t mesh) {
  const MeshRoot& root = scene.roots[mesh];
  return {{scene.meshes.octree.nodes.data + root.first_node, root.node_count},
          {scene.meshes.octree.triangles.data + root.first_triangle, root.triangle_count}};
}

OCTRACE_HD OCTRACE_FORCE_INLINE float row_times(const float* row, const Vec3& v) {
  return fma_rn(row[0], v.x, fma_rn(row[1], v.y, mul_rn(row[2], v.z)));
}

OCTRACE_HD OCTRACE_FORCE_INLINE Vec3 direction_to_mesh(const Instance& instance, const Vec3& v) {
  return Vec3(row_times(instance.to_mesh[0], v), row_times(instance.to_mesh[1], v),
              row_times(instance.to_mesh[2], v));
}

// A ray in a mesh's space. Its origin is where the world's ray enters the instance's box, so that
// its roundings are small beside the instance however far away the ray begins; its direction is not
// scaled, so a hit's t in the world is add_rn(start, t in the mesh's space).
struct MeshRay {
  float start;
  float tmin, tmax;  // in the world: where the instance may be hit
  Ray ray;           // its tmin and tmax hold every t whose sum with start is in [tmin, tmax]
};

// Bounds of t in the mesh's space that rounding cannot make too narrow: subtracting and adding
// `start` are off by at most u (|t| + |start|) together twice, and 2^-22 is four of that.
OCTRACE_HD OCTRACE_FORCE_INLINE float mesh_t_margin(float t, float start) {
  return mul_rn(add_rn(abs_of(t), start), 0x1p-22f);
}
OCTRACE_HD OCTRACE_FORCE_INLINE float latest_mesh_t(float t, float start) {
  return add_rn(sub_rn(t, start), mesh_t_margin(t, start));
}
OCTRACE_HD OCTRACE_FORCE_INLINE float earliest_mesh_t(float t, float start) {
  return sub_rn(sub_rn(t, start), mesh_t_margin(t, start));
}

// False where the instance cannot be hit with tmin <= t <= tmax. `start` depends on the box and the
// line alone: a ray that goes on behind a hit must find the same t for it as before.
OCTRACE_HD OCTRACE_FORCE_INLINE bool enter_instance(const Instance& instance, const Vec3& lower,
                                                    const Vec3& upper, const SlabRay& slab_ray,
                                                    const Vec3& direction, float tmin, float tmax,
                                                    MeshRay* result) {
  // Within these every product of the box and triangle tests stays in float's range. An instance
  // smaller than 2^-44 of its distance lies outside, and is missed by every walk alike.
  constexpr float kFarthest = 0x1p20f, kLongest = 0x1p60f, kShortest = 0x1p-55f;
  const Interval interval = slab(relative_to(lower, slab_ray.origin),
                                 relative_to(upper, slab_ray.origin), slab_ray.inverse);
  result->tmin = greater(tmin, interval.near);
  result->tmax = lesser(tmax, interval.far);
  if (!(result->tmin <= result->tmax)) return false;
  const float start = greater(interval.near, 0.0f);
  const Vec3 o = slab_ray.origin, d = direction;
  const Vec3 at(fma_rn(start, d.x, sub_rn(o.x, instance.to_mesh[0][3])),
                fma_rn(start, d.y, sub_rn(o.y, instance.to_mesh[1][3])),
                fma_rn(start, d.z, sub_rn(o.z, instance.to_mesh[2][3])));
  const Vec3 origin = direction_to_mesh(instance, at);
  const Vec3 along = direction_to_mesh(instance, d);
  const float distance = greater(greater(abs_of(origin.x), abs_of(origin.y)), abs_of(origin.z));
  const float length = greater(greater(abs_of(along.x), abs_of(along.y)), abs_of(along.z));
  if (!(distance <= kFarthest && length >= kShortest && length <= kLongest)) return false;
  result->start = start;
  result->ray = {origin, earliest_mesh_t(result->tmin, start), along,
                 latest_mesh_t(result->tmax, start)};
  return true;
}

}  // namespace octrace::kernels
