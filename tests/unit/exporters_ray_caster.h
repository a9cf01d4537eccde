// What a scene looks like, from the definitions alone: double precision, every triangle, no tree,
// no code of the tracer's or the exporters'.
#pragma once

#include <vector>

#include "backend/scene/scene.h"

namespace octrace::test {

struct Sight {
  double depth = 0.0;        // planar
  std::uint32_t object = 0;  // index + 1; 0: nothing
};

struct CastOptions {
  int width = 64, height = 48;
  bool cull = true, alpha = true;
};

std::vector<Sight> cast_rays(const scene::Scene& scene, const scene::Camera& camera,
                             const CastOptions& options);

}  // namespace octrace::test
