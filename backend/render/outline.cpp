#include "backend/render/outline.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace octrace::render {

namespace {

using glm::dvec3;

// Of the largest coordinate; nothing here is more than 2 sqrt(3) of it away. Rounding moves a float
// ray, and the corners by whose exact signs the triangle test takes or leaves it, by 2^-20 of it at
// the most. (Where on the ray the hit is may be less exact, but that does not matter to a plane
// that the whole ray lies beyond.)
constexpr double kMargin = 4e-4;

}  // namespace

Outline::Outline(const kernels::OctreeView& octree, const kernels::RayCamera& camera)
    : at_zero_{camera.origin, camera.direction},
      along_x_{camera.origin_x, camera.direction_x},
      along_y_{camera.origin_y, camera.direction_y},
      perspective_(along_x_.origin == dvec3(0.0) && along_y_.origin == dvec3(0.0)),
      orthographic_(along_x_.direction == dvec3(0.0) && along_y_.direction == dvec3(0.0)) {
  if (octree.nodes.size == 0) return;
  const kernels::Node& root = octree.nodes[0];
  for (int slot = 0; slot < kernels::kChildren; ++slot) {
    if (root.meta[slot] == 0) continue;
    Box& box = boxes_[static_cast<std::size_t>(box_count_++)];
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = root.origin[axis] + std::ldexp(root.lower[axis][slot], root.exponent[axis]);
      box.upper[axis] = root.origin[axis] + std::ldexp(root.upper[axis][slot], root.exponent[axis]);
    }
  }
}

Outline::CornerRay Outline::corner(double x, double y) const {
  return {at_zero_.origin + x * along_x_.origin + y * along_y_.origin,
          at_zero_.direction + x * along_x_.direction + y * along_y_.direction};
}

bool Outline::may_see(const Tile& pixels) const {
  if (box_count_ == 0) return false;
  if (!perspective_ && !orthographic_) return true;
  const double x0 = pixels.x0, x1 = pixels.x1, y0 = pixels.y0, y1 = pixels.y1;
  const std::array<CornerRay, 4> corners = {corner(x0, y0), corner(x1, y0), corner(x1, y1),
                                            corner(x0, y1)};
  std::array<bool, kernels::kChildren> gone{};
  int left = box_count_;
  for (std::size_t i = 0; i < 4 && left > 0; ++i) {
    const CornerRay &from = corners[i], &to = corners[(i + 1) % 4];
    dvec3 normal = perspective_ ? glm::cross(from.direction, to.direction)
                                : glm::cross(to.origin - from.origin, from.direction);
    // The other corners, and so all rays between, are on its inner side.
    const auto side = [&](const CornerRay& ray) {
      return glm::dot(normal, perspective_ ? ray.direction : ray.origin - from.origin);
    };
    const double a = side(corners[(i + 2) % 4]), b = side(corners[(i + 3) % 4]);
    if (a < 0.0 && b < 0.0) {
      normal = -normal;
    } else if (!(a > 0.0 && b > 0.0)) {
      continue;
    }
    for (std::size_t box = 0; box < static_cast<std::size_t>(box_count_); ++box) {
      if (gone[box] || !beyond(boxes_[box], from.origin, normal)) continue;
      gone[box] = true;
      --left;
    }
  }
  return left > 0;
}

// Whether the box is on the outer side of the plane, with a margin. A number that is none: no.
bool Outline::beyond(const Box& box, const dvec3& origin, const dvec3& normal) const {
  dvec3 nearest;
  double size = 0.0;  // of all that is rounded
  for (int i = 0; i < 3; ++i) {
    nearest[i] = (normal[i] > 0.0 ? box.upper[i] : box.lower[i]) - origin[i];
    size = std::max({size, std::fabs(box.lower[i]), std::fabs(box.upper[i]), std::fabs(origin[i])});
  }
  return glm::dot(normal, nearest) < -kMargin * size * glm::length(normal);
}

}  // namespace octrace::render
