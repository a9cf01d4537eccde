// octrace on a GPU over a buffer of rays: rays read from and hits written to device memory.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/util/result.h"
#include "kernels/ray.h"

namespace octrace::bench {

class RayGpu {
 public:
  virtual ~RayGpu() = default;
  virtual std::string name() const = 0;
  virtual util::Result<void> load(const std::vector<kernels::Ray>& rays) = 0;
  // Traces the rays loaded last.
  virtual util::Result<std::vector<kernels::Hit>> trace(bool any_hit) = 0;
  virtual util::Result<double> time(bool any_hit) = 0;  // seconds, by the device's own clock
};

// Exit 4 where this program was built without CUDA. The octree is uploaded at once.
util::Result<std::unique_ptr<RayGpu>> make_ray_gpu(const octree::Octree& octree, int device);

}  // namespace octrace::bench
