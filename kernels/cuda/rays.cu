// A buffer of rays, for benchmarks and for comparing hits with the CPU's. Persistent warps: when
// too few lanes of a warp still have a ray, it stops and refills the idle ones from a counter (Aila
// and Laine 2009, "Understanding the efficiency of ray traversal on GPUs"; dynamic fetch as in
// Ylitie, Karras and Laine 2017).
#include "kernels/cuda/status.h"
#include "kernels/cuda/tracer.h"

namespace octrace::kernels::cuda {

namespace {

constexpr unsigned kBlock = 64;
constexpr unsigned kWarp = 32;
constexpr unsigned kAllLanes = 0xffffffffu;
// Live lanes below which a warp refills.
constexpr int kRefillBelow = 20;

struct RayJob {
  const Ray* rays;
  Hit* hits;
  std::uint64_t count;
};

// What a lane carries for its ray. Leaf functors refer to parts of it, so they are made for each
// use.
template <bool kAnyHit>
struct Lane {
  Walk walk;
  TriangleRay triangle_ray;
  Hit hit;
  std::uint64_t index;

  __device__ bool test(const SceneView& scene, const RenderParams& params) {
    const std::uint32_t triangle = walk.next_triangle();
    if constexpr (kAnyHit) {
      TransmittanceLeaf leaf{scene, params, walk.ray, triangle_ray, walk.tmin, 0u};
      const bool blocked = leaf(triangle, walk.tmax);
      if (blocked) hit.triangle = 0;
      return blocked;
    } else {
      ClosestLeaf leaf{scene, params, walk.ray, triangle_ray, walk.tmin, hit};
      leaf(triangle, walk.tmax);
      hit = leaf.hit;
      return false;
    }
  }
};

// Hands out rays in the order of the buffer: one atomic for all idle lanes of a warp.
__device__ std::uint64_t fetch(bool idle, unsigned long long* next) {
  const unsigned idle_lanes = __ballot_sync(kAllLanes, idle);
  const unsigned lane = threadIdx.x % kWarp;
  unsigned long long first = 0;
  const int leader = __ffs(static_cast<int>(idle_lanes)) - 1;
  if (static_cast<int>(lane) == leader) first = atomicAdd(next, __popc(idle_lanes));
  first = __shfl_sync(kAllLanes, first, leader);
  return first + __popc(idle_lanes & ((1u << lane) - 1u));
}

template <bool kAnyHit>
__global__ void __launch_bounds__(kBlock)
    rays_kernel(const __grid_constant__ SceneView scene,
                const __grid_constant__ RenderParams params, const RayJob job, Report* report) {
  const Ray nothing{Vec3(0.0f), 0.0f, Vec3(0.0f, 0.0f, 1.0f), 0.0f};
  Lane<kAnyHit> lane{Walk(scene.octree, nothing), make_triangle_ray(nothing.direction), {}, 0};
  WalkStack stack;
  bool live = false, more = true;
  for (;;) {
    if (more) {
      const std::uint64_t index = fetch(!live, &report->next_ray);
      if (!live && index < job.count) {
        const Ray ray = job.rays[index];
        lane.walk.restart(scene.octree, ray);
        lane.triangle_ray = make_triangle_ray(ray.direction);
        lane.hit = {ray.tmax, 0.0f, 0.0f, kNone};
        lane.index = index;
        live = true;
      } else if (!live) {
        more = false;
      }
      more = __all_sync(kAllLanes, more);
    }
    if (!__any_sync(kAllLanes, live)) return;
    const int refill_below = more ? kRefillBelow : 1;
    do {
      if (live) {
        live = lane.walk.next_node(scene.octree, SimtChildTest{}, stack);
        while (live && lane.walk.triangles != 0) {
          if (lane.test(scene, params)) live = false;
        }
        if (!live) {
          job.hits[lane.index] = lane.hit;
          if (lane.walk.status != TraceStatus::ok) {
            report_failure(report, lane.walk.status, static_cast<std::uint32_t>(lane.index), 0);
          }
        }
      }
    } while (__popc(__ballot_sync(kAllLanes, live)) >= refill_below);
  }
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

template <bool kAnyHit>
Status launch(const SceneView& scene, const RenderParams& params, const RayJob& job, Report* report,
              cudaStream_t stream) {
  unsigned blocks = 0;
  if (Status s = resident_blocks(rays_kernel<kAnyHit>, &blocks); !s.ok()) return s;
  const std::uint64_t needed = (job.count + kBlock - 1) / kBlock;
  if (needed < blocks) blocks = static_cast<unsigned>(needed);
  const cudaError_t cleared =
      cudaMemsetAsync(&report->next_ray, 0, sizeof report->next_ray, stream);
  if (cleared != cudaSuccess) return status_of(cleared, "clearing the ray counter");
  rays_kernel<kAnyHit><<<blocks, kBlock, 0, stream>>>(scene, params, job, report);
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
  const RayJob job{rays, hits, count};
  const auto on = static_cast<cudaStream_t>(stream);
  return any_hit ? launch<true>(scene, geometry_only, job, report, on)
                 : launch<false>(scene, geometry_only, job, report, on);
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
