// Which parts of an image cannot show anything: pictures of single objects are mostly background,
// and a ray that misses costs as much as setting it up and asking the octree's root.
#pragma once

#include <array>
#include <glm/vec3.hpp>

#include "backend/render/tiles.h"
#include "kernels/camera.h"
#include "kernels/node.h"

namespace octrace::render {

class Outline {
 public:
  Outline(const kernels::OctreeView& octree, const kernels::RayCamera& camera);

  // False: no ray through these pixels can hit. They are on the outer side of a plane through two
  // neighbouring corners' rays, and so by much more than a hit may stray, is every box of the root.
  bool may_see(const Tile& pixels) const;

 private:
  struct CornerRay {
    glm::dvec3 origin, direction;
  };
  struct Box {
    glm::dvec3 lower, upper;
  };
  CornerRay corner(double x, double y) const;
  bool beyond(const Box& box, const glm::dvec3& origin, const glm::dvec3& normal) const;

  CornerRay at_zero_, along_x_, along_y_;
  bool perspective_, orthographic_;
  std::array<Box, kernels::kChildren> boxes_;
  int box_count_ = 0;
};

}  // namespace octrace::render
