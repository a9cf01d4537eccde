// The two GPU sides of the seed's experiment.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"
#include "backend/util/result.h"
#include "kernels/camera.h"
#include "kernels/ray.h"
#include "tests/bench/seed_tree.h"

namespace octrace::bench {

class PaperGpu {
 public:
  struct Seconds {
    double image = 0.0;    // from the launch to the hits in host memory
    double kernels = 0.0;  // between two events around the launches
  };

  virtual ~PaperGpu() = default;
  virtual std::string name() const = 0;
  // hits may be null. The fast path returns t and the triangle only.
  virtual util::Result<Seconds> trace_seed(const kernels::RayCamera& camera,
                                           std::uint32_t band_rows,
                                           std::vector<kernels::Hit>* hits) = 0;
  virtual util::Result<Seconds> trace_fast(const kernels::RayCamera& camera,
                                           std::vector<kernels::Hit>* hits) = 0;
};

// Uploads everything; exit 4 where this program was built without CUDA.
util::Result<std::unique_ptr<PaperGpu>> make_paper_gpu(const scene::Scene& scene,
                                                       const octree::Octree& octree,
                                                       const SeedTree& seed, int width, int height,
                                                       int device);

}  // namespace octrace::bench
