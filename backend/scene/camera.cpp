#include "backend/scene/camera.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "backend/scene/camera_frame.h"
#include "backend/scene/scene.h"

namespace octrace::scene {

namespace {

using glm::dvec3;

kernels::Vec3 rounded(const dvec3& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Length without overflow or underflow of the squares; 0 where v is no direction at all.
dvec3 unit_or_zero(const dvec3& v) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(largest > 0.0) || !std::isfinite(largest)) return dvec3(0.0);
  const dvec3 scaled = v / largest;
  return scaled / std::sqrt(glm::dot(scaled, scaled));
}

dvec3 any_perpendicular(const dvec3& unit) {
  const dvec3 helper = std::abs(unit.y) < 0.9 ? dvec3(0, 1, 0) : dvec3(0, 0, -1);
  return unit_or_zero(helper - glm::dot(helper, unit) * unit);
}

}  // namespace

CameraFrame orthonormal_frame(const glm::dmat4& matrix) {
  CameraFrame frame;
  frame.back = unit_or_zero(dvec3(matrix[2]));
  if (frame.back == dvec3(0.0)) {
    frame.back = unit_or_zero(glm::cross(dvec3(matrix[0]), dvec3(matrix[1])));
  }
  if (frame.back == dvec3(0.0)) frame.back = dvec3(0, 0, 1);

  const auto without_back = [&](const dvec3& column) {
    const dvec3 unit = unit_or_zero(column);
    const dvec3 rest = unit - glm::dot(unit, frame.back) * frame.back;
    return glm::dot(rest, rest) > 1e-24 ? unit_or_zero(rest) : dvec3(0.0);
  };
  const dvec3 right = without_back(dvec3(matrix[0]));
  frame.up = without_back(dvec3(matrix[1]));
  if (frame.up == dvec3(0.0)) {
    frame.up = right != dvec3(0.0) ? glm::cross(frame.back, right) : any_perpendicular(frame.back);
  }
  frame.right = unit_or_zero(glm::cross(frame.up, frame.back));
  if (glm::dot(frame.right, right) < 0.0) frame.right = -frame.right;
  frame.eye = dvec3(matrix[3]);
  return frame;
}

kernels::RayCamera make_ray_camera(const Camera& camera, int width, int height) {
  const CameraFrame frame = orthonormal_frame(camera.matrix);
  const double w = width, h = height;
  const dvec3 forward = -frame.back;

  // A pixel position (x, y) maps to the camera's plane at depth 1 (orthographic: at any depth) as
  // right * (x0 + x * dx) + up * (y0 + y * dy).
  double x0 = 0, dx = 0, y0 = 0, dy = 0;
  if (camera.type == CameraType::pinhole) {
    const double sx = camera.width > 0 ? w / camera.width : 1.0;
    const double sy = camera.height > 0 ? h / camera.height : 1.0;
    dx = 1.0 / (camera.fx * sx);
    dy = -1.0 / (camera.fy * sy);
    x0 = -camera.cx / camera.fx;
    y0 = camera.cy / camera.fy;
  } else {
    const bool perspective = camera.type == CameraType::perspective;
    const double half = perspective ? std::tan(0.5 * camera.yfov) : camera.ymag;
    // Of xmag only the sign counts, which mirrors the image as it does in a projection matrix.
    const double half_x = perspective ? half : std::copysign(half, camera.xmag);
    dx = 2.0 * half_x / h;
    dy = -2.0 * half / h;
    x0 = -half_x * w / h;
    y0 = half;
  }

  kernels::RayCamera rays{};
  const dvec3 corner = frame.right * x0 + frame.up * y0;
  if (camera.type == CameraType::orthographic) {
    rays.origin = rounded(frame.eye + corner);
    rays.origin_x = rounded(frame.right * dx);
    rays.origin_y = rounded(frame.up * dy);
    rays.direction = rounded(forward);
  } else {
    rays.origin = rounded(frame.eye);
    rays.direction = rounded(forward + corner);
    rays.direction_x = rounded(frame.right * dx);
    rays.direction_y = rounded(frame.up * dy);
  }
  rays.znear = static_cast<float>(camera.znear);
  rays.zfar = static_cast<float>(camera.zfar);
  rays.axis = rounded(forward);
  return rays;
}

Camera look_at(const dvec3& eye, const dvec3& target, double yfov) {
  Camera camera;
  camera.yfov = yfov;
  const dvec3 back = unit_or_zero(eye - target);
  const dvec3 right = unit_or_zero(glm::cross(dvec3(0, 1, 0), back));
  camera.matrix = {{right, 0}, {glm::cross(back, right), 0}, {back, 0}, {eye, 1}};
  return camera;
}

Camera frame_bounds(const Bounds& bounds, double aspect) {
  dvec3 lower(-0.5), upper(0.5);
  if (!bounds.empty) {
    lower = dvec3(bounds.lower);
    upper = dvec3(bounds.upper);
  }
  const dvec3 centre = 0.5 * (lower + upper);
  dvec3 half = 0.5 * (upper - lower);
  const double size = std::max({half.x, half.y, half.z});
  // A point, or what float cannot tell from one this far out, is shown as a box around it.
  const double least =
      1e-5 * std::max({std::abs(centre.x), std::abs(centre.y), std::abs(centre.z)});
  if (!(size > least)) half = dvec3(std::max(least, size > 0.0 ? size : 0.5));

  const double yfov = 0.7;
  const double tan_y = std::tan(0.5 * yfov), tan_x = tan_y * (aspect > 0.0 ? aspect : 1.0);
  Camera camera = look_at(dvec3(0.55, 0.42, 0.85), dvec3(0.0), yfov);
  const dvec3 right(camera.matrix[0]), up(camera.matrix[1]), back(camera.matrix[2]);

  // The least distance from the centre at which every corner lies within the frustum; a corner at
  // height h over the plane through the centre is nearer to the eye by h.
  double distance = 0.0, nearest = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const dvec3 c = half * dvec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const double toward = glm::dot(c, back);
    nearest = std::max(nearest, toward);
    distance = std::max({distance, toward + std::abs(glm::dot(c, right)) / tan_x,
                         toward + std::abs(glm::dot(c, up)) / tan_y});
  }
  distance *= 1.08;
  camera.matrix[3] = glm::dvec4(centre + back * distance, 1.0);
  camera.znear = 0.5 * (distance - nearest);
  camera.name = "framed";
  return camera;
}

}  // namespace octrace::scene
