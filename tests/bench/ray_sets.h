// The three ray sets that ray tracers are measured by. All rays of a set are made before the clock
// starts and lie in one buffer, in the order given here.
#pragma once

#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"
#include "kernels/camera.h"
#include "kernels/ray.h"

namespace octrace::bench {

enum class RaySet {
  primary,  // every pixel centre, in 4x4-pixel tiles; closest hit
  bounce,   // a cosine-weighted ray from each primary hit, in the order of the primaries; closest
            // hit
  ao,       // the same with other random numbers, at most 0.1 of the diagonal long; any hit
};

inline constexpr float kNoLimit = 1e30f;

struct Rays {
  RaySet set = RaySet::primary;
  bool any_hit = false;
  std::vector<kernels::Ray> rays;
};

std::vector<kernels::Ray> primary_rays(const kernels::RayCamera& camera, int width, int height);

// From the hits of the primary rays; origins are moved along the facing geometric normal by 1e-4 of
// the scene's diagonal.
Rays secondary_rays(RaySet set, const scene::Scene& scene, const std::vector<kernels::Ray>& primary,
                    const std::vector<kernels::Hit>& hits);

const char* name_of(RaySet set);

}  // namespace octrace::bench
