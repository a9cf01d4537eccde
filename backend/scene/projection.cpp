#include "backend/scene/projection.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "backend/scene/camera_frame.h"

namespace octrace::scene {

using glm::dvec3;
using glm::dvec4;

Projection make_projection(const Camera& camera, int width, int height) {
  const CameraFrame frame = orthonormal_frame(camera.matrix);
  const double w = width, h = height;
  Projection projection;
  projection.orthographic = camera.type == CameraType::orthographic;
  if (camera.type == CameraType::pinhole) {
    const double sx = camera.width > 0 ? w / camera.width : 1.0;
    const double sy = camera.height > 0 ? h / camera.height : 1.0;
    projection.fx = camera.fx * sx;
    projection.fy = camera.fy * sy;
    projection.cx = camera.cx * sx;
    projection.cy = camera.cy * sy;
  } else {
    const double half = projection.orthographic ? camera.ymag : std::tan(0.5 * camera.yfov);
    projection.fy = 0.5 * h / half;
    projection.fx =
        projection.orthographic ? std::copysign(projection.fy, camera.xmag) : projection.fy;
    projection.cx = 0.5 * w;
    projection.cy = 0.5 * h;
  }
  // The frame of a mirroring matrix is left-handed; the mirror belongs to the intrinsics.
  const dvec3 right = glm::cross(frame.up, frame.back);
  if (glm::dot(right, frame.right) < 0.0) projection.fx = -projection.fx;
  projection.opengl_to_world = {dvec4(right, 0), dvec4(frame.up, 0), dvec4(frame.back, 0),
                                dvec4(frame.eye, 1)};
  projection.opencv_to_world = {dvec4(right, 0), dvec4(-frame.up, 0), dvec4(-frame.back, 0),
                                dvec4(frame.eye, 1)};
  return projection;
}

glm::dmat4 rigid_inverse(const glm::dmat4& matrix) {
  const glm::dmat3 rotation = glm::transpose(glm::dmat3(matrix));
  const dvec3 translation = -(rotation * dvec3(matrix[3]));
  return {dvec4(rotation[0], 0), dvec4(rotation[1], 0), dvec4(rotation[2], 0),
          dvec4(translation, 1)};
}

}  // namespace octrace::scene
