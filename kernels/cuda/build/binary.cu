// The binary tree over the triangles of the curve: H-PLOC (Benthin, Meister, Barczak, Mehalwal,
// Tsakok, Kensler 2024, "H-PLOC: hierarchical parallel locally-ordered clustering for bounding
// volume hierarchy construction"). Threads climb the radix tree of the curve's keys; wherever two
// ranges meet that together hold more than kMergeThreshold triangles, the warp merges nearest
// clusters among the two ranges' roots until at most that many are left.
//
// Which clusters merge depends on the keys alone, so the tree is the same every time; only its
// nodes' numbers depend on the order in which warps run.
#include "kernels/cuda/build/plan.h"
#include "kernels/cuda/build/stages.h"

namespace octrace::kernels::cuda {

namespace {

constexpr int kBlock = 64;
constexpr int kWarps = kBlock / 32;
constexpr unsigned kAll = 0xffffffffu;
constexpr std::uint32_t kMergeThreshold = 16;  // half a warp, so that two ranges' roots fit one
constexpr int kSearchRadius = 16;

// A subtree's root as one lane holds it.
struct Cluster {
  float lower[3], upper[3];
  std::uint32_t node;
  std::uint32_t triangles;
};

__device__ float half_area(const float lower[3], const float upper[3]) {
  const float x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
  return x * y + y * z + z * x;
}

// Nodes and clusters are written by other multiprocessors meanwhile: never from the L1 cache.
__device__ Cluster load_cluster(const BuildScratch& scratch, std::uint32_t node,
                                std::uint32_t leaves) {
  const float4* p = reinterpret_cast<const float4*>(scratch.binary + node);
  const float4 a = __ldcg(p), b = __ldcg(p + 1);
  const std::uint32_t triangles = node < leaves ? 1u : __ldcg(scratch.sizes + (node - leaves));
  return {{a.x, a.y, a.z}, {b.x, b.y, b.z}, node, triangles};
}

__device__ Plan load_plan(const BuildScratch& scratch, const Cluster& cluster,
                          std::uint32_t leaves) {
  if (cluster.node < leaves) return plan_leaf(half_area(cluster.lower, cluster.upper));
  Plan plan;
  const uint4* p = reinterpret_cast<const uint4*>(scratch.plans + (cluster.node - leaves));
  reinterpret_cast<uint4*>(&plan)[0] = __ldcg(p);
  reinterpret_cast<uint4*>(&plan)[1] = __ldcg(p + 1);
  return plan;
}

__device__ Cluster shuffle(const Cluster& mine, int lane) {
  Cluster other;
  for (int axis = 0; axis < 3; ++axis) {
    other.lower[axis] = __shfl_sync(kAll, mine.lower[axis], lane);
    other.upper[axis] = __shfl_sync(kAll, mine.upper[axis], lane);
  }
  other.node = __shfl_sync(kAll, mine.node, lane);
  other.triangles = __shfl_sync(kAll, mine.triangles, lane);
  return other;
}

// The lane, within kSearchRadius and below count, that makes the smallest box with this one. Equal
// areas go by the pair of lanes, so that every pair has one place in the order and the first of
// all is mutual: a round always merges.
__device__ int nearest(const Cluster& mine, int lane, int count) {
  std::uint64_t best = ~0ull;
  for (int r = 1; r <= kSearchRadius; ++r) {
    float lower[3], upper[3];
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = fminf(mine.lower[axis], __shfl_down_sync(kAll, mine.lower[axis], r));
      upper[axis] = fmaxf(mine.upper[axis], __shfl_down_sync(kAll, mine.upper[axis], r));
    }
    const std::uint64_t key = static_cast<std::uint64_t>(__float_as_uint(half_area(lower, upper)))
                                  << 32 |
                              static_cast<std::uint32_t>(lane * 32 + lane + r);
    if (lane + r < count && key < best) best = key;
    const std::uint64_t from_below = __shfl_up_sync(kAll, key, r);
    if (lane >= r && lane < count && from_below < best) best = from_below;
  }
  const int low = static_cast<int>(best >> 5) & 31, high = static_cast<int>(best) & 31;
  return low == lane ? high : low;
}

// One round: every mutual pair becomes a node. Returns how many clusters are left, moved to the
// lowest lanes in their order.
__device__ int merge_round(const BuildScratch& scratch, std::uint32_t leaves, int lane, int count,
                           Cluster& mine, std::uint8_t* sources) {
  const int other = nearest(mine, lane, count);
  const bool returned = __shfl_sync(kAll, other, other & 31) == lane;
  const bool mutual = lane < count && returned;
  const bool creates = mutual && lane < other;
  const unsigned created = __ballot_sync(kAll, creates);
  const unsigned below = (1u << lane) - 1u;
  std::uint32_t base = 0;
  if (lane == 0) base = atomicAdd(&scratch.counters->binary_nodes, __popc(created));
  base = __shfl_sync(kAll, base, 0);
  const Cluster partner = shuffle(mine, other & 31);
  if (creates) {
    const std::uint32_t index = base + __popc(created & below);
    const std::uint32_t left = mine.node;
    const Plan left_plan = load_plan(scratch, mine, leaves);
    const Plan right_plan = load_plan(scratch, partner, leaves);
    for (int axis = 0; axis < 3; ++axis) {
      mine.lower[axis] = fminf(mine.lower[axis], partner.lower[axis]);
      mine.upper[axis] = fmaxf(mine.upper[axis], partner.upper[axis]);
    }
    mine.node = leaves + index;
    mine.triangles += partner.triangles;
    float4* p = reinterpret_cast<float4*>(scratch.binary + mine.node);
    __stcg(p, make_float4(mine.lower[0], mine.lower[1], mine.lower[2], __uint_as_float(left)));
    __stcg(p + 1,
           make_float4(mine.upper[0], mine.upper[1], mine.upper[2], __uint_as_float(partner.node)));
    __stcg(scratch.sizes + index, mine.triangles);
    const Plan plan =
        plan_node(left_plan, right_plan, half_area(mine.lower, mine.upper), mine.triangles);
    uint4* q = reinterpret_cast<uint4*>(scratch.plans + index);
    __stcg(q, reinterpret_cast<const uint4*>(&plan)[0]);
    __stcg(q + 1, reinterpret_cast<const uint4*>(&plan)[1]);
  }
  const bool stays = lane < count && (!mutual || creates);
  const unsigned kept = __ballot_sync(kAll, stays);
  if (stays) sources[__popc(kept & below)] = static_cast<std::uint8_t>(lane);
  __syncwarp();
  const int left_over = __popc(kept);
  mine = shuffle(mine, lane < left_over ? sources[lane] : lane);
  __syncwarp();
  return left_over;
}

// Merges the roots of [left, split) and [split, right], which stand at the ranges' beginnings. All
// lanes of the warp call it with the same arguments.
__device__ void merge_ranges(const BuildScratch& scratch, std::uint32_t leaves, int lane,
                             std::uint32_t left, std::uint32_t split, std::uint32_t right,
                             bool last, std::uint8_t* sources) {
  const std::uint32_t left_most = min(split - left, kMergeThreshold);
  const std::uint32_t right_most = min(right - split + 1, kMergeThreshold);
  const std::uint32_t place = static_cast<std::uint32_t>(lane);
  std::uint32_t root = kNone;
  if (place < left_most) root = __ldcg(scratch.clusters + left + place);
  const int left_count = __popc(__ballot_sync(kAll, root != kNone));
  const std::uint32_t in_right = place - static_cast<std::uint32_t>(left_count);
  if (lane >= left_count) {
    root = in_right < right_most ? __ldcg(scratch.clusters + split + in_right) : kNone;
  }
  const int loaded = __popc(__ballot_sync(kAll, root != kNone));
  Cluster mine = load_cluster(scratch, root == kNone ? 0u : root, leaves);
  int count = loaded;
  const int most = last ? 1 : static_cast<int>(kMergeThreshold);
  while (count > most) count = merge_round(scratch, leaves, lane, count, mine, sources);
  if (lane < loaded) __stcg(scratch.clusters + left + place, lane < count ? mine.node : kNone);
  __threadfence();
  __syncwarp();
}

// How far apart the keys on both sides of border i are: between triangles i and i + 1. Equal keys
// are told apart by their places.
struct Distance {
  std::uint64_t keys;
  std::uint32_t places;
  __device__ bool operator<(const Distance& other) const {
    return keys != other.keys ? keys < other.keys : places < other.places;
  }
};

__device__ Distance distance_at(const std::uint64_t* keys, std::uint32_t i) {
  const std::uint64_t difference = keys[i] ^ keys[i + 1];
  return {difference, difference == 0 ? i ^ (i + 1) : 0u};
}

__global__ void __launch_bounds__(kBlock) cluster(std::uint32_t leaves, BuildScratch scratch) {
  __shared__ std::uint8_t sources[kWarps][32];
  const int lane = threadIdx.x % 32;
  std::uint32_t left = blockIdx.x * kBlock + threadIdx.x;
  std::uint32_t right = left, split = 0;
  bool active = left < leaves;
  while (__any_sync(kAll, active)) {
    if (active) {
      // The parent lies across the border with the nearer keys (Apetrei 2014); whoever comes there
      // first leaves its range's far end for the second, who climbs on.
      const bool to_right =
          left == 0 || (right != leaves - 1 && distance_at(scratch.sorted_keys, right) <
                                                   distance_at(scratch.sorted_keys, left - 1));
      const std::uint32_t border = to_right ? right : left - 1;
      const std::uint32_t met = atomicExch(scratch.parents + border, to_right ? left : right);
      if (met == kNone) {
        active = false;
      } else if (to_right) {
        split = right + 1;
        right = met;
      } else {
        split = left;
        left = met;
      }
      __threadfence();
    }
    const std::uint32_t size = right - left + 1;
    const bool last = active && size == leaves;
    unsigned merging = __ballot_sync(kAll, active && (size > kMergeThreshold || last));
    while (merging != 0) {
      const int owner = __ffs(static_cast<int>(merging)) - 1;
      merging &= merging - 1;
      merge_ranges(scratch, leaves, lane, __shfl_sync(kAll, left, owner),
                   __shfl_sync(kAll, split, owner), __shfl_sync(kAll, right, owner),
                   __shfl_sync(kAll, static_cast<int>(last), owner) != 0,
                   sources[threadIdx.x / 32]);
    }
    if (last) active = false;
  }
}

}  // namespace

Status launch_binary(std::uint32_t triangles, const BuildScratch& scratch, cudaStream_t stream) {
  if (triangles > 1) {
    cluster<<<(triangles + kBlock - 1) / kBlock, kBlock, 0, stream>>>(triangles, scratch);
  }
  return launch_status("building the binary tree");
}

}  // namespace octrace::kernels::cuda
