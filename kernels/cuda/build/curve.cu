// Sorts the triangles along a Morton curve of 21 bits an axis and makes the binary tree's leaves.
#include <algorithm>
#include <cub/device/device_radix_sort.cuh>

#include "kernels/cuda/build/stages.h"

namespace octrace::kernels::cuda {

namespace {

constexpr int kBlock = 256;

struct Bounds {
  Vec3 lower, upper;
};

__device__ Bounds triangle_bounds(const BuildScene& scene, std::uint32_t id) {
  const Triangle t = scene.triangles[id];
  const Vec3 a = scene.positions[t.a], b = scene.positions[t.b], c = scene.positions[t.c];
  Bounds box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = fminf(fminf(a[axis], b[axis]), c[axis]);
    box.upper[axis] = fmaxf(fmaxf(a[axis], b[axis]), c[axis]);
  }
  return box;
}

// Ints in the order of the floats, so that an integer minimum is the floats' minimum.
__device__ int ordered(float value) {
  const int bits = __float_as_int(value);
  return bits >= 0 ? bits : bits ^ 0x7fffffff;
}

__device__ float unordered(int value) {
  return __int_as_float(value >= 0 ? value : value ^ 0x7fffffff);
}

__global__ void reset(BuildCounters* counters) {
  for (int i = 0; i < 6; ++i) counters->bounds[i] = 0x7fffffff;
  counters->binary_nodes = 0;
  counters->blocks_done = 0;
}

__global__ void __launch_bounds__(kBlock) find_bounds(BuildScene scene, BuildCounters* counters) {
  int least[6];
  for (int& value : least) value = 0x7fffffff;
  const std::uint32_t count = static_cast<std::uint32_t>(scene.triangles.size);
  for (std::uint32_t id = blockIdx.x * kBlock + threadIdx.x; id < count; id += gridDim.x * kBlock) {
    const Bounds box = triangle_bounds(scene, id);
    for (int axis = 0; axis < 3; ++axis) {
      least[axis] = min(least[axis], ordered(box.lower[axis]));
      least[3 + axis] = min(least[3 + axis], ordered(-box.upper[axis]));
    }
  }
  for (int i = 0; i < 6; ++i) {
    for (int offset = 16; offset > 0; offset /= 2) {
      least[i] = min(least[i], __shfl_xor_sync(0xffffffffu, least[i], offset));
    }
    if (threadIdx.x % 32 == 0) atomicMin(&counters->bounds[i], least[i]);
  }
}

// Spreads 21 bits to every third place.
__device__ std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x001f00000000ffffull;
  x = (x | x << 16) & 0x001f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

__global__ void __launch_bounds__(kBlock) make_keys(BuildScene scene, BuildScratch scratch) {
  const std::uint32_t id = blockIdx.x * kBlock + threadIdx.x;
  if (id >= scene.triangles.size) return;
  constexpr float kCells = 2097151.0f;
  float extent = 0.0f;
  float origin[3];
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = unordered(scratch.counters->bounds[axis]);
    extent = fmaxf(extent, -unordered(scratch.counters->bounds[3 + axis]) - origin[axis]);
  }
  // Cells are cubes, so that near along the curve is near in space on flat scenes as well.
  const float scale = extent > 0.0f ? kCells / extent : 0.0f;
  const Bounds box = triangle_bounds(scene, id);
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float centre = 0.5f * box.lower[axis] + 0.5f * box.upper[axis];
    const float cell = fminf(fmaxf((centre - origin[axis]) * scale, 0.0f), kCells);
    key |= spread(static_cast<std::uint64_t>(cell)) << axis;
  }
  scratch.keys[id] = key;
  scratch.ids[id] = id;
}

__global__ void __launch_bounds__(kBlock) make_leaves(BuildScene scene, BuildScratch scratch) {
  const std::uint32_t i = blockIdx.x * kBlock + threadIdx.x;
  if (i >= scene.triangles.size) return;
  const std::uint32_t id = scratch.sorted_ids[i];
  const Bounds box = triangle_bounds(scene, id);
  scratch.binary[i] = {box.lower, kNone, box.upper, id};
  scratch.clusters[i] = i;
  scratch.parents[i] = kNone;
}

}  // namespace

std::size_t sort_bytes(std::uint64_t triangles) {
  std::size_t bytes = 0;
  const std::uint64_t* keys = nullptr;
  const std::uint32_t* ids = nullptr;
  cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, const_cast<std::uint64_t*>(keys), ids,
                                  const_cast<std::uint32_t*>(ids),
                                  static_cast<std::int64_t>(triangles), 0, 63);
  return bytes;
}

Status launch_curve(const BuildScene& scene, const BuildScratch& scratch, cudaStream_t stream) {
  const std::uint32_t count = static_cast<std::uint32_t>(scene.triangles.size);
  const std::uint32_t blocks = (count + kBlock - 1) / kBlock;
  reset<<<1, 1, 0, stream>>>(scratch.counters);
  find_bounds<<<std::min(blocks, 1024u), kBlock, 0, stream>>>(scene, scratch.counters);
  make_keys<<<blocks, kBlock, 0, stream>>>(scene, scratch);
  std::size_t bytes = scratch.sort_bytes;
  const cudaError_t error = cub::DeviceRadixSort::SortPairs(
      scratch.sort, bytes, scratch.keys, scratch.sorted_keys, scratch.ids, scratch.sorted_ids,
      static_cast<std::int64_t>(count), 0, 63, stream);
  if (error != cudaSuccess) return status_of(error, "sorting triangles");
  make_leaves<<<blocks, kBlock, 0, stream>>>(scene, scratch);
  return launch_status("sorting triangles");
}

}  // namespace octrace::kernels::cuda
