// A ray and what it hit.
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

// Points origin + t * direction for 0 <= tmin <= t <= tmax. The direction need not have unit
// length: camera rays are scaled so that t is the planar depth.
struct Ray {
  Vec3 origin;
  float tmin;
  Vec3 direction;
  float tmax;
};

// u and v are the barycentric weights of the triangle's second and third corner.
struct Hit {
  float t;
  float u;
  float v;
  std::uint32_t triangle;  // index into the scene's triangles; kNone: nothing was hit

  OCTRACE_HD bool valid() const { return triangle != kNone; }
};

}  // namespace octrace::kernels
