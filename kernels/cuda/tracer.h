// Ray queries inlined into a kernel: the Tracer of kernels/pixel.h on CUDA.
#pragma once

#include "kernels/cuda/child_test.h"
#include "kernels/cuda/cuda.h"
#include "kernels/intersect.h"

namespace octrace::kernels::cuda {

struct Tracer {
  __device__ TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray& ray,
                                 Hit* hit) const {
    return closest_hit(scene, params, ray, SimtChildTest{}, hit);
  }
  __device__ TraceStatus transmittance(const SceneView& scene, const RenderParams& params,
                                       const Ray& ray, float* transmittance) const {
    return shadow_transmittance(scene, params, ray, SimtChildTest{}, transmittance);
  }
};

// The first failure of a launch is the one that is reported.
__device__ inline void report_failure(Report* report, TraceStatus status, std::uint32_t x,
                                      std::uint32_t y) {
  if (atomicCAS(&report->status, 0u, static_cast<std::uint32_t>(status)) == 0u) {
    report->x = x;
    report->y = y;
  }
}

}  // namespace octrace::kernels::cuda
