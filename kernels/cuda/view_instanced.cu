// One thread a pixel of a scene with instances: the kernels of view.cu with a tracer that goes
// through two levels of octrees.
#include "kernels/cuda/child_test.h"
#include "kernels/cuda/status.h"
#include "kernels/cuda/tracer.h"
#include "kernels/instance_intersect.h"
#include "kernels/instance_motion.h"
#include "kernels/pixel.h"

namespace octrace::kernels::cuda {

namespace {

constexpr unsigned kBlockWidth = 8, kBlockHeight = 8;

struct InstancedTracer {
  __device__ TraceStatus closest(const InstancedSceneView& scene, const RenderParams& params,
                                 const Ray& ray, InstancedHit* hit) const {
    return closest_hit(scene, params, ray, SimtChildTest{}, hit);
  }
  __device__ TraceStatus transmittance(const InstancedSceneView& scene, const RenderParams& params,
                                       const Ray& ray, float* transmittance) const {
    return shadow_transmittance(scene, params, ray, SimtChildTest{}, transmittance);
  }
};

__device__ bool pixel_of_thread(const View& view, std::uint32_t* x, std::uint32_t* y) {
  *x = blockIdx.x * kBlockWidth + threadIdx.x;
  const std::uint32_t row = blockIdx.y * kBlockHeight + threadIdx.y;
  *y = view.target.first_row + row;
  return *x < view.target.width && row < view.target.height;
}

template <bool kMotion>
__global__ void __launch_bounds__(kBlockWidth* kBlockHeight)
    instanced_geometry_kernel(const __grid_constant__ InstancedView view, Report* report) {
  std::uint32_t x, y;
  if (!pixel_of_thread(view, &x, &y)) return;
  TraceStatus status;
  if constexpr (kMotion) {
    status = trace_geometry(view.instanced, view.camera, view.params, view.target, x, y,
                            InstancedTracer{}, MotionPlane{view.motion});
  } else {
    status = trace_geometry(view.instanced, view.camera, view.params, view.target, x, y,
                            InstancedTracer{});
  }
  if (status != TraceStatus::ok) report_failure(report, status, x, y);
}

__global__ void __launch_bounds__(kBlockWidth* kBlockHeight)
    instanced_beauty_kernel(const __grid_constant__ InstancedView view, Report* report) {
  std::uint32_t x, y;
  if (!pixel_of_thread(view, &x, &y)) return;
  RayCounts counts;
  const TraceStatus status = trace_beauty(view.instanced, view.camera, view.params, view.target, x,
                                          y, InstancedTracer{}, &counts);
  if (status != TraceStatus::ok) report_failure(report, status, x, y);
  atomicAdd(&report->beauty_rays, static_cast<unsigned long long>(counts.beauty));
  atomicAdd(&report->shadow_rays, static_cast<unsigned long long>(counts.shadow));
}

}  // namespace

Status launch_instanced_view(const InstancedView& view, Report* report, Stream stream) {
  const dim3 block(kBlockWidth, kBlockHeight);
  const dim3 grid((view.target.width + kBlockWidth - 1) / kBlockWidth,
                  (view.target.height + kBlockHeight - 1) / kBlockHeight);
  const auto on = static_cast<cudaStream_t>(stream);
  if (view.geometry) {
    if (view.has_motion) {
      instanced_geometry_kernel<true><<<grid, block, 0, on>>>(view, report);
    } else {
      instanced_geometry_kernel<false><<<grid, block, 0, on>>>(view, report);
    }
    if (Status s = launch_status("launching the geometry kernel of instances"); !s.ok()) return s;
  }
  if (view.beauty) {
    instanced_beauty_kernel<<<grid, block, 0, on>>>(view, report);
    if (Status s = launch_status("launching the beauty kernel of instances"); !s.ok()) return s;
  }
  return {};
}

}  // namespace octrace::kernels::cuda
