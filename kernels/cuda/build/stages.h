// The stages of the octree builder on the GPU, in the order in which build.cu enqueues them:
// triangles along a Morton curve, a binary tree over them (H-PLOC), eight-way nodes out of that.
#pragma once

#include "kernels/cuda/build/plan.h"
#include "kernels/cuda/cuda.h"
#include "kernels/cuda/status.h"

namespace octrace::kernels::cuda {

// A node of the binary tree. Index i < triangles is a leaf: the i-th triangle of the curve, whose
// id stands in `right`.
struct alignas(16) BinaryNode {
  Vec3 lower;
  std::uint32_t left;
  Vec3 upper;
  std::uint32_t right;
};
static_assert(sizeof(BinaryNode) == 32);

struct BuildCounters {
  int bounds[6];               // lower and negated upper corner, as ints that order like the floats
  std::uint32_t binary_nodes;  // inner ones
  std::uint32_t blocks_done;   // of the running level
  std::uint32_t level_starts[kMaxDepth + 2];
};

// Where the stages keep what they hand on, within one allocation.
struct BuildScratch {
  BuildCounters* counters;
  std::uint64_t *keys, *sorted_keys;
  std::uint32_t *ids, *sorted_ids;
  void* sort;
  std::size_t sort_bytes;
  BinaryNode* binary;       // 2 * triangles
  std::uint32_t* sizes;     // triangles below each inner binary node
  Plan* plans;              // of each inner binary node
  std::uint32_t* clusters;  // roots of the forest so far, along the curve
  std::uint32_t* parents;   // the far end of the range that waits at each border
  std::uint32_t* tasks;     // the binary node that each eight-way node is made of
};

// Sums up what stands where; with memory == nullptr only the bytes.
std::uint64_t lay_out(std::uint64_t triangles, std::uint64_t node_capacity, void* memory,
                      BuildScratch* scratch);

std::size_t sort_bytes(std::uint64_t triangles);
Status launch_curve(const BuildScene& scene, const BuildScratch& scratch, cudaStream_t stream);
Status launch_binary(std::uint32_t triangles, const BuildScratch& scratch, cudaStream_t stream);
Status launch_collapse(const BuildScene& scene, const BuildScratch& scratch,
                       const BuildTarget& target, cudaStream_t stream);

}  // namespace octrace::kernels::cuda
