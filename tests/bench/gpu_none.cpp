// A build without CUDA.
#include "tests/bench/build_gpu.h"
#include "tests/bench/paper_gpu.h"
#include "tests/bench/ray_gpu.h"

namespace octrace::bench {

namespace {

util::Error no_cuda() {
  return {util::Exit::unsupported, "", "this octrace-bench was built without CUDA", "", ""};
}

}  // namespace

util::Result<std::unique_ptr<PaperGpu>> make_paper_gpu(const scene::Scene&, const octree::Octree&,
                                                       const SeedTree&, int, int, int) {
  return no_cuda();
}

util::Result<GpuBuild> build_on_gpu(const scene::Scene&, int, int) { return no_cuda(); }

util::Result<std::unique_ptr<RayGpu>> make_ray_gpu(const octree::Octree&, int) { return no_cuda(); }

}  // namespace octrace::bench
