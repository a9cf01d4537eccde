// Where a point of a surface goes in the image from one frame to the next. Kept out of pixel.h's
// own work: it is a template argument there, so that images without this plane pay nothing for it.
#pragma once

#include "kernels/aov.h"
#include "kernels/ray.h"
#include "kernels/scene_view.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

// The inverse of camera_ray(): position p lies at pixel (dot(x, q), dot(y, q)) / w with
// q = p - origin, where w = dot(depth, q) of a perspective camera, 1 of an orthographic one.
struct Projection {
  Vec3 origin{0.0f}, x{0.0f}, y{0.0f}, depth{0.0f};
  std::uint32_t perspective = 1;
};

// False where the point is not in front of a perspective camera.
OCTRACE_HD inline bool project(const Projection& camera, Vec3 point, Vec2* pixel) {
  const Vec3 q = point - camera.origin;
  const float w = camera.perspective != 0 ? dot(camera.depth, q) : 1.0f;
  if (!(w > 0.0f)) return false;
  *pixel = Vec2(dot(camera.x, q) / w, dot(camera.y, q) / w);
  return is_finite(pixel->x) && is_finite(pixel->y);
}

struct Instance;

struct MotionView {
  Span<Vec3> next_positions;  // as SceneView::positions; empty: no vertex moves
  Projection now, next;
  Span<Instance> next_instances;  // as InstancedSceneView::instances; empty: no instance moves
};

OCTRACE_HD inline Vec2 motion_between(const MotionView& motion, Vec3 here, Vec3 there) {
  Vec2 from, to;
  if (!project(motion.now, here, &from) || !project(motion.next, there, &to)) return Vec2(0.0f);
  return to - from;
}

// In pixels, +x to the right, +y down: where the point will be less where it is. Both ends go
// through project(), so that what stands still has a motion of exactly 0. 0 where nothing is hit or
// the point goes behind the camera.
OCTRACE_HD inline Vec2 motion_of(const SceneView& scene, const MotionView& motion, const Hit& hit) {
  const Triangle& corners = scene.triangles[hit.triangle];
  const auto at = [&](const Span<Vec3>& positions) {
    const Vec3 a = positions[corners.a];
    return a + (hit.u * (positions[corners.b] - a) + hit.v * (positions[corners.c] - a));
  };
  const Vec3 here = at(scene.positions);
  const Vec3 there = motion.next_positions.empty() ? here : at(motion.next_positions);
  return motion_between(motion, here, there);
}

// What trace_geometry() does with a hit beside its own planes.
struct NoMotion {
  template <class Scene, class Planes>
  OCTRACE_HD void operator()(const Scene&, const HitOf<Scene>&, const Planes&,
                             std::uint64_t) const {}
};
struct MotionPlane {
  const MotionView& motion;
  template <class Scene, class Planes>
  OCTRACE_HD void operator()(const Scene& scene, const HitOf<Scene>& hit, const Planes& to,
                             std::uint64_t pixel) const {
    const Vec2 value = hit.valid() ? motion_of(scene, motion, hit) : Vec2(0.0f);
    float* plane = to.floats(Aov::motion);
    plane[2 * pixel] = value.x;
    plane[2 * pixel + 1] = value.y;
  }
};

}  // namespace octrace::kernels
