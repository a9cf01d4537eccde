// What a camera does to a point, as computer vision writes it: intrinsics in pixels and a rigid
// camera-to-world matrix.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "backend/scene/camera.h"

namespace octrace::scene {

// A point (X, Y, Z) of the OpenCV camera (X right, Y down, Z forward) appears at
//   x = cx + fx X / Z, y = cy + fy Y / Z   (orthographic: x = cx + fx X, y = cy + fy Y)
// pixels from the image's top left corner, so that the first pixel's centre is (0.5, 0.5). Z is the
// planar depth. A camera that mirrors its image has a negative fx or fy; the matrices never mirror.
struct Projection {
  bool orthographic = false;
  double fx = 1, fy = 1, cx = 0, cy = 0;  // pixels; orthographic fx, fy: pixels a metre
  glm::dmat4 opengl_to_world{1.0};        // rigid; axes X right, Y up, Z backward, as glTF
  glm::dmat4 opencv_to_world{1.0};        // rigid; axes X right, Y down, Z forward
};

Projection make_projection(const Camera& camera, int width, int height);

// Of a rotation and a translation.
glm::dmat4 rigid_inverse(const glm::dmat4& matrix);

}  // namespace octrace::scene
