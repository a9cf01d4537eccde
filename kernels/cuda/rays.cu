// A buffer of rays, for benchmarks and for comparing hits with the CPU's. Persistent warps: when
// too few lanes of a warp still have a ray, it stops and refills the idle ones from a counter (Aila
// and Laine 2009, "Understanding the efficiency of ray traversal on GPUs"; dynamic fetch as in
// Ylitie, Karras and Laine 2017).
#include "kernels/cuda/status.h"
#include "kernels/cuda/warp_tracer.h"

namespace octrace::kernels::cuda {

namespace {

constexpr unsigned kBlock = 128;
// Blocks that a multiprocessor holds: any-hit queries need fewer registers.
template <bool kAnyHit>
constexpr unsigned kBlocks = kAnyHit ? 8 : 7;
// Live lanes below which a warp refills.
constexpr int kRefillBelow = 20;

// How many rays ahead of its own a lane asks for.
constexpr std::uint64_t kAhead = 32768;

struct RayBuffer {
  static constexpr bool kAlpha = false;
  const Ray* rays;
  Hit* hits;
  std::uint64_t size;

  __device__ std::uint64_t count() const { return size; }
  __device__ Ray load(std::uint64_t index) const {
    const float4* p = reinterpret_cast<const float4*>(rays + index);
    const float4 a = __ldg(p), b = __ldg(p + 1);
    return {Vec3(a.x, a.y, a.z), a.w, Vec3(b.x, b.y, b.z), b.w};
  }
  // The rays that this warp or another will load next come from memory meanwhile.
  __device__ void prefetch(std::uint64_t index) const {
    if (index + kAhead < size) {
      asm volatile("prefetch.global.L2 [%0];" : : "l"(rays + index + kAhead));
    }
  }
  __device__ void store(std::uint64_t index, const Hit& hit) const {
    reinterpret_cast<float4*>(hits)[index] =
        make_float4(hit.t, hit.u, hit.v, __uint_as_float(hit.triangle));
  }
};

template <bool kAnyHit, bool kOrder>
__global__ void __launch_bounds__(kBlock, kBlocks<kAnyHit>)
    rays_kernel(const __grid_constant__ SceneView scene,
                const __grid_constant__ RenderParams params, const RayBuffer rays, Report* report) {
  __shared__ BlockShared block;
  __shared__ WarpShared shared[kBlock / kWarp];
  block.fill();
  __syncthreads();
  trace_rays<kAnyHit, kOrder, kRefillBelow>(scene, params, rays, shared[threadIdx.x / kWarp], block,
                                            report);
}

// As many blocks as the device holds at once.
template <class Kernel>
Status resident_blocks(Kernel kernel, unsigned* blocks) {
  int device = 0, multiprocessors = 0, per_multiprocessor = 0;
  Status s = status_of(cudaGetDevice(&device), "asking for the device");
  if (s.ok()) {
    s = status_of(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device),
                  "counting multiprocessors");
  }
  if (s.ok()) {
    s = status_of(
        cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_multiprocessor, kernel, kBlock, 0),
        "asking for the occupancy");
  }
  *blocks = static_cast<unsigned>(multiprocessors * per_multiprocessor);
  return s;
}

template <bool kAnyHit, bool kOrder>
Status launch(const SceneView& scene, const RenderParams& params, const RayBuffer& rays,
              Report* report, cudaStream_t stream) {
  const auto kernel = rays_kernel<kAnyHit, kOrder>;
  unsigned blocks = 0;
  if (Status s = resident_blocks(kernel, &blocks); !s.ok()) return s;
  const std::uint64_t needed = (rays.size + kBlock - 1) / kBlock;
  if (needed < blocks) blocks = static_cast<unsigned>(needed);
  const cudaError_t cleared =
      cudaMemsetAsync(&report->next_ray, 0, sizeof report->next_ray, stream);
  if (cleared != cudaSuccess) return status_of(cleared, "clearing the ray counter");
  kernel<<<blocks, kBlock, 0, stream>>>(scene, params, rays, report);
  return launch_status("launching the ray kernel");
}

}  // namespace

Status launch_rays(const OctreeView& octree, const RenderParams& params, const Ray* rays, Hit* hits,
                   std::uint64_t count, bool any_hit, Report* report, Stream stream) {
  if (count == 0) return {};
  SceneView scene;
  scene.octree = octree;
  RenderParams geometry_only = params;
  geometry_only.alpha = 0;
  const RayBuffer buffer{rays, hits, count};
  const auto on = static_cast<cudaStream_t>(stream);
  if (any_hit) return launch<true, false>(scene, geometry_only, buffer, report, on);
  return octree.cut ? launch<false, true>(scene, geometry_only, buffer, report, on)
                    : launch<false, false>(scene, geometry_only, buffer, report, on);
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
