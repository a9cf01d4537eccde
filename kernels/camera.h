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

// A ray's two parts: what x alone gives, and what y adds to it. For many pixels each is computed
// once a column and once a row.
struct CameraRayPart {
  Vec3 origin, direction;
};
OCTRACE_HD inline CameraRayPart camera_column(const RayCamera& camera, float x) {
  return {camera.origin + x * camera.origin_x, camera.direction + x * camera.direction_x};
}
OCTRACE_HD inline CameraRayPart camera_row(const RayCamera& camera, float y) {
  return {y * camera.origin_y, y * camera.direction_y};
}
OCTRACE_HD inline Ray camera_ray(const RayCamera& camera, const CameraRayPart& column,
                                 const CameraRayPart& row) {
  return {column.origin + row.origin, camera.znear, column.direction + row.direction, camera.zfar};
}
OCTRACE_HD inline Ray camera_ray(const RayCamera& camera, float x, float y) {
  return camera_ray(camera, camera_column(camera, x), camera_row(camera, y));
}

}  // namespace octrace::kernels
