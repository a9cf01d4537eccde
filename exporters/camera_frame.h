// Where a camera stands and what rectangle it sees, in double precision: derived here a second
// time, so that a mistake in the tracer's own rays shows up in the comparison.
#pragma once

#include <glm/vec3.hpp>

#include "backend/scene/camera.h"

namespace octrace::exporters {

struct CameraFrame {
  // Orthonormal, in the world; mirrored where the camera's matrix or magnitudes mirror.
  glm::dvec3 right{1, 0, 0}, up{0, 1, 0}, back{0, 0, 1};
  glm::dvec3 eye{0.0};
  // The image's borders in the plane at depth 1 (orthographic: at any depth), along right and up:
  // left < right_edge, bottom < top.
  double left = -1, right_edge = 1, bottom = -1, top = 1;
  bool orthographic = false;

  double depth_of(const glm::dvec3& point) const;
};

CameraFrame camera_frame(const scene::Camera& camera, int width, int height);

}  // namespace octrace::exporters
