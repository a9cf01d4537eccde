#include "backend/render/motion.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace octrace::render {

kernels::Projection make_projection(const kernels::RayCamera& camera) {
  using glm::dvec3;
  const bool perspective =
      camera.direction_x != kernels::Vec3(0.0f) || camera.direction_y != kernels::Vec3(0.0f);
  // A point is origin + s * direction + (s * x) * direction_x + (s * y) * direction_y, or, with
  // parallel rays, origin + s * direction + x * origin_x + y * origin_y. The rows of the inverse of
  // these three columns give s, x and y.
  const dvec3 along(camera.direction);
  const dvec3 right(perspective ? camera.direction_x : camera.origin_x);
  const dvec3 down(perspective ? camera.direction_y : camera.origin_y);
  const double volume = glm::dot(along, glm::cross(right, down));
  kernels::Projection projection;
  if (!(std::abs(volume) > 0.0) || !std::isfinite(volume)) return projection;
  projection.origin = camera.origin;
  projection.depth = kernels::Vec3(glm::cross(right, down) / volume);
  projection.x = kernels::Vec3(glm::cross(down, along) / volume);
  projection.y = kernels::Vec3(glm::cross(along, right) / volume);
  projection.perspective = perspective;
  return projection;
}

kernels::MotionView make_motion_view(const kernels::RayCamera& now, const NextFrame& next) {
  return {{next.positions.data(), next.positions.size()},
          make_projection(now),
          make_projection(next.camera),
          {next.instances.data(), next.instances.size()}};
}

}  // namespace octrace::render
