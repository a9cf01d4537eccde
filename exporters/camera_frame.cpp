#include "exporters/camera_frame.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace octrace::exporters {

namespace {

using glm::dvec3;

// Of v without its part along the unit vector n; zero where nothing is left.
dvec3 perpendicular_unit(const dvec3& v, const dvec3& n) {
  const double length = glm::length(v);
  if (!(length > 0.0) || !std::isfinite(length)) return dvec3(0.0);
  const dvec3 rest = v / length - glm::dot(v / length, n) * n;
  const double rest_length = glm::length(rest);
  return rest_length > 1e-12 ? rest / rest_length : dvec3(0.0);
}

}  // namespace

double CameraFrame::depth_of(const dvec3& point) const { return -glm::dot(back, point - eye); }

CameraFrame camera_frame(const scene::Camera& camera, int width, int height) {
  CameraFrame frame;
  const dvec3 x(camera.matrix[0]), y(camera.matrix[1]), z(camera.matrix[2]);
  frame.eye = dvec3(camera.matrix[3]);

  const double z_length = glm::length(z);
  if (z_length > 0.0 && std::isfinite(z_length)) frame.back = z / z_length;
  frame.up = perpendicular_unit(y, frame.back);
  if (frame.up == dvec3(0.0)) frame.up = perpendicular_unit(glm::cross(frame.back, x), frame.back);
  if (frame.up == dvec3(0.0)) frame.up = perpendicular_unit(dvec3(0, 1, 0), frame.back);
  if (frame.up == dvec3(0.0)) frame.up = perpendicular_unit(dvec3(0, 0, -1), frame.back);
  frame.right = glm::cross(frame.up, frame.back);
  if (glm::dot(frame.right, x) < 0.0) frame.right = -frame.right;

  if (camera.type == scene::CameraType::pinhole) {
    // cx and cy count pixels of an image of camera.width x camera.height from its top left corner.
    const double w = camera.width > 0 ? camera.width : width;
    const double h = camera.height > 0 ? camera.height : height;
    frame.left = -camera.cx / camera.fx;
    frame.right_edge = (w - camera.cx) / camera.fx;
    frame.top = camera.cy / camera.fy;
    frame.bottom = (camera.cy - h) / camera.fy;
  } else {
    frame.orthographic = camera.type == scene::CameraType::orthographic;
    frame.top = frame.orthographic ? camera.ymag : std::tan(0.5 * camera.yfov);
    frame.bottom = -frame.top;
    frame.right_edge = std::abs(frame.top) * width / height;
    if (frame.orthographic) frame.right_edge = std::copysign(frame.right_edge, camera.xmag);
    frame.left = -frame.right_edge;
  }
  // Borders in the wrong order are a view along axes the other way round.
  if (frame.right_edge < frame.left) {
    frame.right = -frame.right;
    frame.left = -frame.left;
    frame.right_edge = -frame.right_edge;
  }
  if (frame.top < frame.bottom) {
    frame.up = -frame.up;
    frame.bottom = -frame.bottom;
    frame.top = -frame.top;
  }
  return frame;
}

}  // namespace octrace::exporters
