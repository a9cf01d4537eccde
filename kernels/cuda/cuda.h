// The one door from host code to CUDA: plain functions, no CUDA types. Every call reports a Status;
// nothing throws, nothing prints.
#pragma once

#include <cstdint>

#include "kernels/aov.h"
#include "kernels/camera.h"
#include "kernels/instance.h"
#include "kernels/motion.h"
#include "kernels/node.h"
#include "kernels/ray.h"
#include "kernels/render_params.h"
#include "kernels/scene_view.h"
#include "kernels/seed.h"

namespace octrace::kernels::cuda {

struct Status {
  int code = 0;           // cudaError_t
  const char* name = "";  // "cudaErrorMemoryAllocation"
  const char* text = "";  // "out of memory"
  const char* call = "";  // what was being done
  bool ok() const { return code == 0; }
  bool out_of_memory() const { return code == 2; }
};

struct Device {
  char name[256];
  int major, minor;  // compute capability
  int multiprocessors;
  std::uint64_t total_bytes, free_bytes;
};

// The oldest compute capability that the kernels are compiled for.
inline constexpr int kOldestMajor = 7, kOldestMinor = 5;

Status count_devices(int* count);
Status select_device(int index);  // for the calling thread; all calls below go to it
Status query_device(int index, Device* device);

// Plain device memory, never managed memory.
Status allocate(void** memory, std::uint64_t bytes);
void release(void* memory);
Status allocate_pinned(void** memory, std::uint64_t bytes);
void release_pinned(void* memory);
// Locks memory of other origin in its place, so that it is copied to and from without a step
// between.
Status pin(void* memory, std::uint64_t bytes);
void unpin(void* memory);

using Stream = void*;
Status create_stream(Stream* stream);
void destroy_stream(Stream stream);
Status synchronize(Stream stream);
Status copy_to_device(void* to, const void* from, std::uint64_t bytes, Stream stream);
Status copy_to_host(void* to, const void* from, std::uint64_t bytes, Stream stream);
Status clear(void* memory, std::uint64_t bytes, Stream stream);

// Marks on a stream that the device takes the time at, for benchmarks.
using Event = void*;
Status create_event(Event* event);
void destroy_event(Event event);
Status record_event(Event event, Stream stream);
Status elapsed(Event start, Event stop, float* milliseconds);  // waits for stop

// What a launch reports beside its pixels, in device memory, zeroed before the launch.
struct Report {
  unsigned long long beauty_rays, shadow_rays;
  unsigned long long next_ray;  // of launch_rays: the first ray that no warp has taken yet
  std::uint32_t status;         // TraceStatus of a pixel that failed; 0: none
  std::uint32_t x, y;           // that pixel
};

// All pointers in scene, target and report are device memory. target.height rows are traced, from
// target.first_row of the image on.
struct View {
  SceneView scene;
  RayCamera camera;
  RenderParams params;
  FramebufferView target;
  bool geometry, beauty;
  bool has_motion;  // target has the plane, and geometry is set
  MotionView motion;
};
Status launch_view(const View& view, Report* report, Stream stream);

// The same of a scene with instances, by kernels of their own. View::scene is not looked at.
struct InstancedView : View {
  InstancedSceneView instanced;
};
Status launch_instanced_view(const InstancedView& view, Report* report, Stream stream);

// Closest or any hit of a buffer of rays, geometry only: culling as params say, alpha ignored.
// Any-hit queries set triangle to 0 where something was hit and to kNone elsewhere.
Status launch_rays(const OctreeView& octree, const RenderParams& params, const Ray* rays, Hit* hits,
                   std::uint64_t count, bool any_hit, Report* report, Stream stream);

// Milliseconds that the device spent on the launch, for benchmarks; waits for its end.
Status time_rays(const OctreeView& octree, const RenderParams& params, const Ray* rays, Hit* hits,
                 std::uint64_t count, bool any_hit, Report* report, float* milliseconds);

// The seed paper's experiment (kernels/seed.h); all pointers are device memory. hits: width *
// height, rows from the top. rows_a_launch > 0.
struct SeedImage {
  SeedView scene;
  RayCamera camera;
  Hit* hits;
  std::uint32_t width, height;
};
Status launch_seed(const SeedImage& image, std::uint32_t rows_a_launch, Report* report,
                   Stream stream);

// The octree built on the device, by clustering along a Morton curve (H-PLOC). All pointers are
// device memory; corner indices have been checked. flags and triangle_geometry may be empty, as in
// octree::BuildInput.
struct BuildScene {
  Span<Vec3> positions;
  Span<Triangle> triangles;  // at least one, fewer than 2^31
  Span<std::uint32_t> triangle_geometry;
  Span<std::uint32_t> flags;
};
enum class BuildFailure : std::uint32_t { none, too_many_nodes, too_deep };
struct BuildReport {
  std::uint32_t nodes, triangles;
  BuildFailure failure;
};
struct BuildTarget {
  Node* nodes;
  std::uint32_t node_capacity;  // build_node_capacity() always suffices
  LeafTriangle* triangles;      // as many as the scene has
  BuildReport* report;
};
std::uint64_t build_node_capacity(std::uint64_t triangles);
std::uint64_t build_scratch_bytes(std::uint64_t triangles);
// scratch: build_scratch_bytes() bytes, aligned to 256.
Status launch_build(const BuildScene& scene, void* scratch, const BuildTarget& target,
                    Stream stream);

}  // namespace octrace::kernels::cuda
