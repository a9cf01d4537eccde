// The octree that a GPU builds, and how long it takes.
#pragma once

#include <vector>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"

namespace octrace::bench {

struct GpuBuild {
  octree::Octree octree;
  std::vector<double>
      seconds;  // of each repeat, by the device's clock, device memory to device memory
};

// One build warms up, `repeats` are timed. Exit 4 without CUDA.
util::Result<GpuBuild> build_on_gpu(const scene::Scene& scene, int device, int repeats);

}  // namespace octrace::bench
