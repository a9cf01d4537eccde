// The two questions that the renderer asks of a scene, as leaf functors for traverse().
#pragma once

#include <cmath>

#include "kernels/alpha.h"
#include "kernels/render_params.h"
#include "kernels/scene_view.h"
#include "kernels/traverse.h"
#include "kernels/triangle.h"

namespace octrace::kernels {

OCTRACE_HD OCTRACE_FORCE_INLINE bool culls_back(const LeafTriangle& triangle,
                                                const RenderParams& params) {
  return params.cull != 0 && (triangle.flags & kCullBack) != 0;
}

// Nearest hit. Of triangles hit at the same t the one with the lowest index wins, so that the order
// of visits does not matter.
struct ClosestLeaf {
  const SceneView& scene;
  const RenderParams& params;
  const SlabRay& slab_ray;
  TriangleRay triangle_ray;
  float tmin;
  Hit hit;

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle triangle = load(scene.octree.triangles[index]);
    TriangleHit found;
    if (!intersect_triangle(slab_ray, triangle_ray, triangle.a, triangle.b, triangle.c, tmin, tmax,
                            culls_back(triangle, params), &found)) {
      return false;
    }
    if (hit.valid() && found.t == hit.t && triangle.triangle > hit.triangle) return false;
    if ((triangle.flags & kAlphaTest) != 0 && params.alpha != 0 &&
        !alpha_passes(scene, triangle.geometry, triangle.triangle, found.u, found.v)) {
      return false;
    }
    hit = {found.t, found.u, found.v, triangle.triangle};
    tmax = found.t;
    return false;
  }
};

// Shadow rays: anything opaque blocks, from either side, for a wall that cannot be seen from behind
// still casts a shadow; BLEND surfaces let 1 - alpha through. The dimming is summed as
// an integer logarithm, because integer sums do not depend on the order of visits.
inline constexpr float kOpacityOne = 65536.0f;               // -log2(transmittance) * kOpacityOne
inline constexpr std::uint32_t kOpacityBlocked = 24u << 16;  // 2^-24 is dark enough

struct SurfaceName {
  std::uint32_t triangle, flags, geometry;
};

// What the surface at a hit adds to `opacity`. True: nothing comes through any more.
OCTRACE_HD OCTRACE_FORCE_INLINE bool dim(const SceneView& scene, const RenderParams& params,
                                         const SurfaceName& surface, const TriangleHit& found,
                                         std::uint32_t* opacity) {
  if (params.alpha != 0 && (surface.flags & kAlphaTest) != 0 &&
      !alpha_passes(scene, surface.geometry, surface.triangle, found.u, found.v)) {
    return false;
  }
  if (params.alpha != 0 && (surface.flags & kBlend) != 0) {
    const float alpha = surface_alpha(scene, surface.geometry, surface.triangle, found.u, found.v);
    const float clear = lesser(greater(1.0f - alpha, 1.0f / (1 << 25)), 1.0f);
    *opacity += static_cast<std::uint32_t>(-log2f(clear) * kOpacityOne);
    return *opacity >= kOpacityBlocked;
  }
  *opacity = kOpacityBlocked;
  return true;
}

OCTRACE_HD OCTRACE_FORCE_INLINE float transmittance_of(std::uint32_t opacity) {
  if (opacity == 0) return 1.0f;  // most often
  return opacity >= kOpacityBlocked ? 0.0f : exp2f(-static_cast<float>(opacity) / kOpacityOne);
}

struct TransmittanceLeaf {
  const SceneView& scene;
  const RenderParams& params;
  const SlabRay& slab_ray;
  TriangleRay triangle_ray;
  float tmin;
  std::uint32_t opacity;

  OCTRACE_HD OCTRACE_FORCE_INLINE bool operator()(std::uint32_t index, float& tmax) {
    const LeafTriangle triangle = load(scene.octree.triangles[index]);
    TriangleHit found;
    if (!intersect_triangle(slab_ray, triangle_ray, triangle.a, triangle.b, triangle.c, tmin, tmax,
                            false, &found)) {
      return false;
    }
    return dim(scene, params, {triangle.triangle, triangle.flags, triangle.geometry}, found,
               &opacity);
  }
};

OCTRACE_HD OCTRACE_FORCE_INLINE ClosestLeaf closest_leaf(const SceneView& scene,
                                                         const RenderParams& params,
                                                         const Walk& walk, const Ray& ray) {
  return {scene,    params,
          walk.ray, make_triangle_ray(ray.direction),
          ray.tmin, {ray.tmax, 0.0f, 0.0f, kNone}};
}

OCTRACE_HD OCTRACE_FORCE_INLINE TransmittanceLeaf transmittance_leaf(const SceneView& scene,
                                                                     const RenderParams& params,
                                                                     const Walk& walk,
                                                                     const Ray& ray) {
  return {scene, params, walk.ray, make_triangle_ray(ray.direction), ray.tmin, 0u};
}

template <class ChildTest>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus closest_hit(const SceneView& scene,
                                                        const RenderParams& params, const Ray& ray,
                                                        const ChildTest& child_test, Hit* hit) {
  Walk walk(scene.octree, ray);
  ClosestLeaf leaf = closest_leaf(scene, params, walk, ray);
  const TraceStatus status = traverse(scene.octree, walk, child_test, leaf);
  *hit = leaf.hit;
  return status;
}

template <class ChildTest>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus shadow_transmittance(const SceneView& scene,
                                                                 const RenderParams& params,
                                                                 const Ray& ray,
                                                                 const ChildTest& child_test,
                                                                 float* transmittance) {
  Walk walk(scene.octree, ray);
  TransmittanceLeaf leaf = transmittance_leaf(scene, params, walk, ray);
  const TraceStatus status = traverse(scene.octree, walk, child_test, leaf);
  *transmittance = transmittance_of(leaf.opacity);
  return status;
}

}  // namespace octrace::kernels
