// The renderer's two questions, asked of a scene with instances: first the world's own triangles,
// then the instances, up to the hit that is nearest by then. Of hits at the same t the world's own
// triangles win, then the lowest instance, then the lowest triangle.
#pragma once

#include "kernels/instance.h"
#include "kernels/intersect.h"

namespace octrace::kernels {

// A mesh's triangles, for the nearest hit.
struct MeshClosestLeaf {
  const InstancedSceneView& scene;
  const RenderParams& params;
  const OctreeView octree;
  const SlabRay& slab_ray;
  TriangleRay triangle_ray;
  const MeshRay& bounds;
  std::uint32_t instance;
  InstancedHit& hit;

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle triangle = load(octree.triangles[index]);
    TriangleHit found;
    if (!intersect_triangle(slab_ray, triangle_ray, triangle.a, triangle.b, triangle.c,
                            bounds.ray.tmin, tmax, culls_back(triangle, params), &found)) {
      return false;
    }
    const float t = add_rn(bounds.start, found.t);
    if (!(t >= bounds.tmin && t <= bounds.tmax && t <= hit.t)) return false;
    if (hit.valid() && t == hit.t && loses(triangle.triangle)) return false;
    if ((triangle.flags & kAlphaTest) != 0 && params.alpha != 0 &&
        !alpha_passes(scene.meshes, triangle.geometry, triangle.triangle, found.u, found.v)) {
      return false;
    }
    hit = {{t, found.u, found.v, triangle.triangle}, instance};
    tmax = lesser(tmax, latest_mesh_t(t, bounds.start));
    return false;
  }

 private:
  OCTRACE_HD OCTRACE_FORCE_INLINE bool loses(std::uint32_t triangle) const {
    return hit.instance == kNone || instance > hit.instance ||
           (instance == hit.instance && triangle > hit.triangle);
  }
};

template <class ChildTest>
struct InstanceClosestLeaf {
  const InstancedSceneView& scene;
  const RenderParams& params;
  const SlabRay& slab_ray;
  const Vec3& direction;
  float tmin;
  const ChildTest& child_test;
  InstancedHit hit;
  TraceStatus status;

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle box = load(scene.top.triangles[index]);
    const Instance& instance = scene.instances[box.triangle];
    MeshRay bounds;
    if (!enter_instance(instance, box.a, box.b, slab_ray, direction, tmin, tmax, &bounds)) {
      return false;
    }
    const OctreeView octree = octree_of(scene, box.geometry);
    Walk walk(octree, bounds.ray);
    MeshClosestLeaf leaf{
        scene,  params,       octree, walk.ray, make_triangle_ray(bounds.ray.direction),
        bounds, box.triangle, hit};
    status = traverse(octree, walk, child_test, leaf);
    tmax = lesser(tmax, hit.t);
    return status != TraceStatus::ok;
  }
};

// A mesh's triangles, for shadow rays.
struct MeshTransmittanceLeaf {
  const InstancedSceneView& scene;
  const RenderParams& params;
  const OctreeView octree;
  const SlabRay& slab_ray;
  TriangleRay triangle_ray;
  const MeshRay& bounds;
  std::uint32_t& opacity;  // as in TransmittanceLeaf

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle triangle = load(octree.triangles[index]);
    TriangleHit found;
    if (!intersect_triangle(slab_ray, triangle_ray, triangle.a, triangle.b, triangle.c,
                            bounds.ray.tmin, tmax, false, &found)) {
      return false;
    }
    const float t = add_rn(bounds.start, found.t);
    if (!(t >= bounds.tmin && t <= bounds.tmax)) return false;
    return dim(scene.meshes, params, {triangle.triangle, triangle.flags, triangle.geometry}, found,
               &opacity);
  }
};

template <class ChildTest>
struct InstanceTransmittanceLeaf {
  const InstancedSceneView& scene;
  const RenderParams& params;
  const SlabRay& slab_ray;
  const Vec3& direction;
  float tmin;
  const ChildTest& child_test;
  std::uint32_t opacity;
  TraceStatus status;

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle box = load(scene.top.triangles[index]);
    const Instance& instance = scene.instances[box.triangle];
    MeshRay bounds;
    if (!enter_instance(instance, box.a, box.b, slab_ray, direction, tmin, tmax, &bounds)) {
      return false;
    }
    const OctreeView octree = octree_of(scene, box.geometry);
    Walk walk(octree, bounds.ray);
    MeshTransmittanceLeaf leaf{
        scene, params, octree, walk.ray, make_triangle_ray(bounds.ray.direction), bounds, opacity};
    status = traverse(octree, walk, child_test, leaf);
    return status != TraceStatus::ok || opacity >= kOpacityBlocked;
  }
};

template <class ChildTest>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus closest_hit(const InstancedSceneView& scene,
                                                        const RenderParams& params, const Ray& ray,
                                                        const ChildTest& child_test,
                                                        InstancedHit* hit) {
  hit->instance = kNone;
  const TraceStatus world =
      closest_hit(static_cast<const SceneView&>(scene), params, ray, child_test, hit);
  if (world != TraceStatus::ok) return world;
  Ray rest = ray;
  rest.tmax = hit->t;
  Walk walk(scene.top, rest);
  InstanceClosestLeaf<ChildTest> leaf{scene,    params,     walk.ray, ray.direction,
                                      ray.tmin, child_test, *hit,     TraceStatus::ok};
  const TraceStatus top = traverse(scene.top, walk, child_test, leaf);
  *hit = leaf.hit;
  return leaf.status != TraceStatus::ok ? leaf.status : top;
}

template <class ChildTest>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus shadow_transmittance(const InstancedSceneView& scene,
                                                                 const RenderParams& params,
                                                                 const Ray& ray,
                                                                 const ChildTest& child_test,
                                                                 float* transmittance) {
  Walk world_walk(scene.octree, ray);
  TransmittanceLeaf world_leaf = transmittance_leaf(scene, params, world_walk, ray);
  const TraceStatus world = traverse(scene.octree, world_walk, child_test, world_leaf);
  *transmittance = 0.0f;
  if (world != TraceStatus::ok || world_leaf.opacity >= kOpacityBlocked) return world;
  Walk walk(scene.top, ray);
  InstanceTransmittanceLeaf<ChildTest> leaf{
      scene,    params,     walk.ray,           ray.direction,
      ray.tmin, child_test, world_leaf.opacity, TraceStatus::ok};
  const TraceStatus top = traverse(scene.top, walk, child_test, leaf);
  *transmittance = transmittance_of(leaf.opacity);
  return leaf.status != TraceStatus::ok ? leaf.status : top;
}

}  // namespace octrace::kernels
