// Turns the binary tree into eight-way nodes, a level a launch, a node a thread: binary nodes
// are opened as planned, the children take slots by octant, boxes are quantised, and the level's
// inner children and leaf triangles get their places.
#include <algorithm>
#include <glm/common.hpp>

#include "kernels/cuda/build/stages.h"
#include "kernels/quantise.h"

namespace octrace::kernels::cuda {

namespace {

constexpr int kBlock = 128;
constexpr unsigned kAll = 0xffffffffu;

struct Child {
  Vec3 lower, upper;
  std::uint32_t node;
  std::uint32_t triangles;
};

class Tree {
 public:
  __device__ Tree(const BuildScratch& scratch, std::uint32_t leaves)
      : binary_(scratch.binary), sizes_(scratch.sizes), plans_(scratch.plans), leaves_(leaves) {}

  __device__ bool leaf(std::uint32_t node) const { return node < leaves_; }
  __device__ std::uint32_t triangles(std::uint32_t node) const {
    return leaf(node) ? 1u : sizes_[node - leaves_];
  }
  __device__ std::uint32_t choices(std::uint32_t node) const {
    return plans_[node - leaves_].choices;
  }
  __device__ const BinaryNode& operator[](std::uint32_t node) const { return binary_[node]; }

  __device__ Child child(std::uint32_t node) const {
    const float4* p = reinterpret_cast<const float4*>(binary_ + node);
    const float4 a = p[0], b = p[1];
    return {Vec3(a.x, a.y, a.z), Vec3(b.x, b.y, b.z), node, triangles(node)};
  }

  // The ids of a subtree of at most kMaxLeafTriangles triangles.
  __device__ void collect(std::uint32_t node, std::uint32_t ids[kMaxLeafTriangles]) const {
    std::uint32_t waiting[kMaxLeafTriangles];
    int depth = 0, found = 0;
    waiting[depth++] = node;
    while (depth > 0) {
      const std::uint32_t top = waiting[--depth];
      if (leaf(top)) {
        ids[found++] = binary_[top].right;
      } else {
        waiting[depth++] = binary_[top].right;
        waiting[depth++] = binary_[top].left;
      }
    }
  }

 private:
  const BinaryNode* binary_;
  const std::uint32_t* sizes_;
  const Plan* plans_;
  std::uint32_t leaves_;
};

// Opens `root` into at most eight children, as the plans say.
__device__ int open_children(const Tree& tree, std::uint32_t root, Child children[kChildren]) {
  if (tree.triangles(root) <= kMaxLeafTriangles) {
    children[0] = tree.child(root);
    return 1;
  }
  struct Share {
    std::uint32_t node;
    int children;
  };
  Share waiting[kChildren];  // each will give a child or more, so eight are enough
  int depth = 0, count = 0;
  const auto split = [&](std::uint32_t node, int share) {
    const int left = left_share(tree.choices(node), share);
    waiting[depth++] = {tree[node].right, share - left};
    waiting[depth++] = {tree[node].left, left};
  };
  split(root, kChildren);
  while (depth > 0) {
    const Share top = waiting[--depth];
    int share = tree.leaf(top.node) ? 1 : top.children;
    while (share > 1 && left_share(tree.choices(top.node), share) == 0) --share;
    if (share == 1) {
      children[count++] = tree.child(top.node);
    } else {
      split(top.node, share);
    }
  }
  return count;
}

// As backend/octree's slots_by_octant(): pairs of a child and a slot are taken greedily, the child
// that lies furthest towards its slot's octant first.
__device__ void assign_slots(const Child children[kChildren], int count, const Vec3& centre,
                             int slots[kChildren]) {
  Vec3 offsets[kChildren];
  for (int c = 0; c < count; ++c) offsets[c] = children[c].lower + children[c].upper - centre;
  unsigned free_slots = 0xffu, free_children = (1u << count) - 1u;
  while (free_children != 0) {
    float best = 1e38f;
    int best_child = lowest_bit(free_children), best_slot = lowest_bit(free_slots);
    for (unsigned cs = free_children; cs != 0; cs &= cs - 1) {
      const int c = lowest_bit(cs);
      for (unsigned ss = free_slots; ss != 0; ss &= ss - 1) {
        const int s = lowest_bit(ss);
        const float cost = (s & 1 ? -offsets[c].x : offsets[c].x) +
                           (s & 2 ? -offsets[c].y : offsets[c].y) +
                           (s & 4 ? -offsets[c].z : offsets[c].z);
        if (cost < best) {
          best = cost;
          best_child = c;
          best_slot = s;
        }
      }
    }
    slots[best_child] = best_slot;
    free_children &= ~(1u << best_child);
    free_slots &= ~(1u << best_slot);
  }
}

__device__ void encode_boxes(const Child children[kChildren], int count, const int slots[kChildren],
                             const Vec3& lower, const Vec3& upper, Node& node) {
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = lower[axis];
    node.origin[axis] = lower[axis];
    node.exponent[axis] = exponent_for(origin, upper[axis]);
    const double scale = ldexp(1.0, node.exponent[axis]);
    for (int c = 0; c < count; ++c) {
      node.lower[axis][slots[c]] = step_below(origin, scale, children[c].lower[axis]);
      node.upper[axis][slots[c]] = step_above(origin, scale, children[c].upper[axis]);
    }
  }
}

__device__ LeafTriangle leaf_triangle(const BuildScene& scene, std::uint32_t id) {
  const Triangle t = scene.triangles[id];
  const std::uint32_t geometry = scene.triangle_geometry.empty() ? 0 : scene.triangle_geometry[id];
  const std::uint32_t flags = scene.flags.empty() ? 0 : scene.flags[geometry];
  return {scene.positions[t.a], id, scene.positions[t.b], flags, scene.positions[t.c], geometry};
}

// Room for `mine` entries of each lane behind one counter; one atomic a warp.
__device__ std::uint32_t reserve(std::uint32_t* counter, std::uint32_t mine) {
  const int lane = threadIdx.x % 32;
  std::uint32_t sum = mine;
  for (int offset = 1; offset < 32; offset *= 2) {
    const std::uint32_t below = __shfl_up_sync(kAll, sum, offset);
    if (lane >= offset) sum += below;
  }
  std::uint32_t base = 0;
  if (lane == 31) base = atomicAdd(counter, sum);
  return __shfl_sync(kAll, base, 31) + sum - mine;
}

struct Level {
  const BuildScene scene;
  const BuildScratch scratch;
  const BuildTarget target;

  // All lanes of a warp call it together; `active` is whether the lane has a node.
  __device__ void make_node(std::uint32_t index, bool active) const {
    const Tree tree(scratch, static_cast<std::uint32_t>(scene.triangles.size));
    Child children[kChildren];
    int slots[kChildren];
    int count = 0;
    Node node = {};
    std::uint32_t inner = 0, triangles = 0;
    int child_at[kChildren];
    if (active) {
      count = open_children(tree, scratch.tasks[index], children);
      Vec3 lower = children[0].lower, upper = children[0].upper;
      for (int c = 1; c < count; ++c) {
        lower = glm::min(lower, children[c].lower);
        upper = glm::max(upper, children[c].upper);
      }
      assign_slots(children, count, lower + upper, slots);
      encode_boxes(children, count, slots, lower, upper, node);
      for (int& at : child_at) at = -1;
      for (int c = 0; c < count; ++c) child_at[slots[c]] = c;
      for (int slot = 0; slot < kChildren; ++slot) {
        if (child_at[slot] < 0) continue;
        const std::uint32_t below = children[child_at[slot]].triangles;
        if (below > kMaxLeafTriangles) {
          node.inner_mask |= static_cast<std::uint8_t>(1u << slot);
          node.meta[slot] = static_cast<std::uint8_t>(0x20 | (24 + slot));
          ++inner;
        } else {
          node.meta[slot] = static_cast<std::uint8_t>(((1u << below) - 1u) << 5 | triangles);
          triangles += below;
        }
      }
    }
    node.first_child = reserve(&target.report->nodes, inner);
    node.first_triangle = reserve(&target.report->triangles, triangles);
    if (!active) return;
    if (node.first_child + inner > target.node_capacity) {
      target.report->failure = BuildFailure::too_many_nodes;
      return;
    }
    std::uint32_t next_child = node.first_child, next_triangle = node.first_triangle;
    for (int slot = 0; slot < kChildren; ++slot) {
      if (child_at[slot] < 0) continue;
      const Child& child = children[child_at[slot]];
      if (child.triangles > kMaxLeafTriangles) {
        scratch.tasks[next_child++] = child.node;
        continue;
      }
      std::uint32_t ids[kMaxLeafTriangles];
      tree.collect(child.node, ids);
      for (std::uint32_t i = 0; i < child.triangles; ++i) {
        target.triangles[next_triangle++] = leaf_triangle(scene, ids[i]);
      }
    }
    target.nodes[index] = node;
  }
};

__global__ void begin(BuildScratch scratch, BuildTarget target) {
  scratch.tasks[0] = scratch.clusters[0];
  scratch.counters->level_starts[0] = 0;
  scratch.counters->level_starts[1] = 1;
  *target.report = {1, 0, BuildFailure::none};
}

__global__ void __launch_bounds__(kBlock) collapse(Level level, int depth) {
  if (level.target.report->failure != BuildFailure::none) return;
  BuildCounters& counters = *level.scratch.counters;
  const std::uint32_t first = counters.level_starts[depth];
  const std::uint32_t end = min(counters.level_starts[depth + 1], level.target.node_capacity);
  for (std::uint32_t base = first + blockIdx.x * kBlock; base < end; base += gridDim.x * kBlock) {
    const std::uint32_t index = base + threadIdx.x;
    level.make_node(index, index < end);
  }
  // The last block to end says where the next level ends.
  __syncthreads();
  if (threadIdx.x != 0) return;
  __threadfence();
  if (atomicAdd(&counters.blocks_done, 1u) != gridDim.x - 1) return;
  const std::uint32_t nodes = atomicAdd(&level.target.report->nodes, 0u);
  counters.level_starts[depth + 2] = nodes;
  counters.blocks_done = 0;
  if (depth == kMaxDepth - 1 && nodes > counters.level_starts[depth + 1]) {
    level.target.report->failure = BuildFailure::too_deep;
  }
}

}  // namespace

Status launch_collapse(const BuildScene& scene, const BuildScratch& scratch,
                       const BuildTarget& target, cudaStream_t stream) {
  begin<<<1, 1, 0, stream>>>(scratch, target);
  const std::uint64_t blocks = (target.node_capacity + kBlock - 1) / kBlock;
  const unsigned grid = static_cast<unsigned>(std::min<std::uint64_t>(blocks, 1024));
  const Level level{scene, scratch, target};
  for (int depth = 0; depth < kMaxDepth; ++depth) {
    collapse<<<grid, kBlock, 0, stream>>>(level, depth);
  }
  return launch_status("making eight-way nodes");
}

}  // namespace octrace::kernels::cuda
