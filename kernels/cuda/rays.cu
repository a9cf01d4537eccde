// One thread a ray, over a buffer of rays: for benchmarks and for comparing hits with the CPU's.
#include "kernels/cuda/status.h"
#include "kernels/cuda/tracer.h"

namespace octrace::kernels::cuda {

namespace {

constexpr unsigned kBlock = 64;

template <bool kAnyHit>
__global__ void __launch_bounds__(kBlock)
    rays_kernel(const __grid_constant__ SceneView scene,
                const __grid_constant__ RenderParams params, const Ray* rays, Hit* hits,
                std::uint64_t count, Report* report) {
  const std::uint64_t i = static_cast<std::uint64_t>(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const Ray ray = rays[i];
  Hit hit{ray.tmax, 0.0f, 0.0f, kNone};
  TraceStatus status;
  if (kAnyHit) {
    float transmittance;
    status = Tracer{}.transmittance(scene, params, ray, &transmittance);
    hit.triangle = transmittance > 0.0f ? kNone : 0u;
  } else {
    status = Tracer{}.closest(scene, params, ray, &hit);
  }
  hits[i] = hit;
  if (status != TraceStatus::ok) report_failure(report, status, static_cast<std::uint32_t>(i), 0);
}

}  // namespace

Status launch_rays(const OctreeView& octree, const RenderParams& params, const Ray* rays, Hit* hits,
                   std::uint64_t count, bool any_hit, Report* report, Stream stream) {
  if (count == 0) return {};
  SceneView scene;
  scene.octree = octree;
  RenderParams geometry_only = params;
  geometry_only.alpha = 0;
  const auto grid = static_cast<unsigned>((count + kBlock - 1) / kBlock);
  const auto on = static_cast<cudaStream_t>(stream);
  if (any_hit) {
    rays_kernel<true><<<grid, kBlock, 0, on>>>(scene, geometry_only, rays, hits, count, report);
  } else {
    rays_kernel<false><<<grid, kBlock, 0, on>>>(scene, geometry_only, rays, hits, count, report);
  }
  return launch_status("launching the ray kernel");
}

Status time_rays(const OctreeView& octree, const RenderParams& params, const Ray* rays, Hit* hits,
                 std::uint64_t count, bool any_hit, Report* report, float* milliseconds) {
  cudaEvent_t start = nullptr, stop = nullptr;
  Status s = status_of(cudaEventCreate(&start), "creating an event");
  if (s.ok()) s = status_of(cudaEventCreate(&stop), "creating an event");
  if (s.ok()) s = status_of(cudaEventRecord(start), "recording an event");
  if (s.ok()) s = launch_rays(octree, params, rays, hits, count, any_hit, report, nullptr);
  if (s.ok()) s = status_of(cudaEventRecord(stop), "recording an event");
  if (s.ok()) s = status_of(cudaEventSynchronize(stop), "tracing");
  if (s.ok()) s = status_of(cudaEventElapsedTime(milliseconds, start, stop), "reading an event");
  if (start != nullptr) cudaEventDestroy(start);
  if (stop != nullptr) cudaEventDestroy(stop);
  return s;
}

}  // namespace octrace::kernels::cuda
