// What a render is told beside the scene and the camera.
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

struct RenderParams {
  std::uint32_t spp = 16;  // beauty only
  std::uint32_t seed = 0;
  std::uint32_t cull = 1;                    // 1: as doubleSided says; 0: never
  std::uint32_t alpha = 1;                   // 1: as alphaMode says; 0: everything is opaque
  std::uint32_t transparent_background = 0;  // 1: beauty's background has alpha 0
  Vec3 sky{0.40f, 0.48f, 0.60f};             // radiance from everywhere, linear
};

}  // namespace octrace::kernels
