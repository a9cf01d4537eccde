// The next frame, as the motion plane needs it.
#pragma once

#include <span>

#include "kernels/camera.h"
#include "kernels/instance.h"
#include "kernels/motion.h"

namespace octrace::render {

struct NextFrame {
  std::span<const kernels::Vec3> positions;  // as Scene::positions; empty: no vertex moves
  kernels::RayCamera camera;
  std::span<const kernels::Instance> instances = {};  // empty: none moves
};

// Computed in double and rounded once. A camera that has no inverse gives one that sees nothing.
kernels::Projection make_projection(const kernels::RayCamera& camera);

// positions stay where they are: in host memory.
kernels::MotionView make_motion_view(const kernels::RayCamera& now, const NextFrame& next);

}  // namespace octrace::render
