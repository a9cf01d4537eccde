// Camera rays. A pixel position (x, y) is measured in pixels from the image's top left corner, so
// the centre of the first pixel is (0.5, 0.5). Rays are scaled so that t is the planar depth: the
// distance along the camera's axis, not along the ray.
#pragma once

#include "kernels/ray.h"

namespace octrace::kernels {

// origin(x, y) = origin + x * origin_x + y * origin_y, and the same for the direction: perspective
// cameras have a constant origin, orthographic ones a constant direction.
struct RayCamera {
  Vec3 origin, origin_x, origin_y;
  Vec3 direction, direction_x, direction_y;
  float znear, zfar;  // planar depth; zfar may be +infinity
  Vec3 axis;          // unit, the way the camera looks
};

OCTRACE_HD inline Ray camera_ray(const RayCamera& camera, float x, float y) {
  return {camera.origin + x * camera.origin_x + y * camera.origin_y, camera.znear,
          camera.direction + x * camera.direction_x + y * camera.direction_y, camera.zfar};
}

}  // namespace octrace::kernels
