// One thread a pixel. Geometry and beauty are kernels of their own, so that depth does not pay for
// the registers of shading.
#include "kernels/cuda/status.h"
#include "kernels/cuda/tracer.h"
#include "kernels/pixel.h"

namespace octrace::kernels::cuda {

namespace {

// A warp covers 8x4 pixels, whose rays stay together longer than those of a row of 32.
constexpr unsigned kBlockWidth = 8, kBlockHeight = 8;

__device__ bool pixel_of_thread(const View& view, std::uint32_t* x, std::uint32_t* y) {
  *x = blockIdx.x * kBlockWidth + threadIdx.x;
  const std::uint32_t row = blockIdx.y * kBlockHeight + threadIdx.y;
  *y = view.target.first_row + row;
  return *x < view.target.width && row < view.target.height;
}

template <bool kMotion>
__global__ void __launch_bounds__(kBlockWidth* kBlockHeight)
    geometry_kernel(const __grid_constant__ View view, Report* report) {
  std::uint32_t x, y;
  if (!pixel_of_thread(view, &x, &y)) return;
  TraceStatus status;
  if constexpr (kMotion) {
    status = trace_geometry(view.scene, view.camera, view.params, view.target, x, y, Tracer{},
                            MotionPlane{view.motion});
  } else {
    status = trace_geometry(view.scene, view.camera, view.params, view.target, x, y, Tracer{});
  }
  if (status != TraceStatus::ok) report_failure(report, status, x, y);
}

__global__ void __launch_bounds__(kBlockWidth* kBlockHeight)
    beauty_kernel(const __grid_constant__ View view, Report* report) {
  __shared__ unsigned long long block_beauty, block_shadow;
  const bool first = threadIdx.x == 0 && threadIdx.y == 0;
  if (first) block_beauty = block_shadow = 0;
  __syncthreads();
  std::uint32_t x, y;
  if (pixel_of_thread(view, &x, &y)) {
    RayCounts counts;
    const TraceStatus status =
        trace_beauty(view.scene, view.camera, view.params, view.target, x, y, Tracer{}, &counts);
    if (status != TraceStatus::ok) report_failure(report, status, x, y);
    atomicAdd(&block_beauty, static_cast<unsigned long long>(counts.beauty));
    atomicAdd(&block_shadow, static_cast<unsigned long long>(counts.shadow));
  }
  __syncthreads();
  if (first) {
    atomicAdd(&report->beauty_rays, block_beauty);
    atomicAdd(&report->shadow_rays, block_shadow);
  }
}

}  // namespace

Status launch_view(const View& view, Report* report, Stream stream) {
  const dim3 block(kBlockWidth, kBlockHeight);
  const dim3 grid((view.target.width + kBlockWidth - 1) / kBlockWidth,
                  (view.target.height + kBlockHeight - 1) / kBlockHeight);
  const auto on = static_cast<cudaStream_t>(stream);
  if (view.geometry) {
    if (view.has_motion) {
      geometry_kernel<true><<<grid, block, 0, on>>>(view, report);
    } else {
      geometry_kernel<false><<<grid, block, 0, on>>>(view, report);
    }
    if (Status s = launch_status("launching the geometry kernel"); !s.ok()) return s;
  }
  if (view.beauty) {
    beauty_kernel<<<grid, block, 0, on>>>(view, report);
    if (Status s = launch_status("launching the beauty kernel"); !s.ok()) return s;
  }
  return {};
}

}  // namespace octrace::kernels::cuda
