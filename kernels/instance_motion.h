// The motion of a point on an instance: that of its mesh, whose vertices are taken to stand still
// in the mesh's own space.
#pragma once

#include "kernels/instance_surface.h"
#include "kernels/motion.h"

namespace octrace::kernels {

OCTRACE_HD inline Vec2 motion_of(const InstancedSceneView& scene, const MotionView& motion,
                                 const InstancedHit& hit) {
  if (hit.instance == kNone) {
    return motion_of(static_cast<const SceneView&>(scene), motion, static_cast<const Hit&>(hit));
  }
  const Triangle& corners = scene.meshes.triangles[hit.triangle];
  const Span<Vec3>& positions = scene.meshes.positions;
  const auto at = [&](const Span<Instance>& instances) {
    InstancedSurface surface;
    surface.instance = &instances[hit.instance];
    const Vec3 a = world_position(surface, positions[corners.a]);
    const Vec3 b = world_position(surface, positions[corners.b]);
    const Vec3 c = world_position(surface, positions[corners.c]);
    return a + (hit.u * (b - a) + hit.v * (c - a));
  };
  const Vec3 here = at(scene.instances);
  const Vec3 there = motion.next_instances.empty() ? here : at(motion.next_instances);
  return motion_between(motion, here, there);
}

}  // namespace octrace::kernels
