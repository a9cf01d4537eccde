// Traces rays by whole warps. Two things keep the lanes of a warp busy where rays do not go the
// same way:
//
// - dynamic fetch: when too few lanes still have a ray, the warp stops and gives new rays to the
//   idle ones (Aila and Laine 2009, "Understanding the efficiency of ray traversal on GPUs");
// - a queue of triangle tests in shared memory: a node step appends (ray, triangle) pairs, and when
//   there are 32 of them each lane tests one, whoever's ray it is. A lane alone would find its few
//   triangles at other times than its neighbours: such loops ran at 3 of 32 lanes and took more
//   than half of the time. (After the compaction of Wald 2011, "Active thread compaction for GPU
//   path tracing", within a warp.)
//
// A ray's tmax shrinks a few node steps late, which costs some nodes but changes no hit: the least
// (t, triangle) wins, in whatever order it is found.
#pragma once

#include "kernels/cuda/box_ray.h"
#include "kernels/cuda/tracer.h"

namespace octrace::kernels::cuda {

inline constexpr unsigned kWarp = 32;
inline constexpr unsigned kAllLanes = 0xffffffffu;

// What the warps of a block share: order[octant][mask] has bit s of mask at bit s ^ octant ^ 7.
struct VisitOrder {
  std::uint8_t order[8][256];

  // By all threads of the block; a barrier must follow.
  __device__ void fill() {
    for (unsigned i = threadIdx.x; i < 8 * 256; i += blockDim.x) {
      const unsigned octant = i / 256, mask = i % 256;
      unsigned ordered = 0;
      for (unsigned slot = 0; slot < 8; ++slot) {
        ordered |= (mask >> slot & 1u) << (slot ^ octant ^ 7u);
      }
      order[octant][mask] = static_cast<std::uint8_t>(ordered);
    }
  }
};

// What the lanes of a warp share.
struct alignas(16) WarpShared {
  float4 ray[4][kWarp];  // as TriangleTestRay lays it out
  float4 hit[kWarp];     // a Hit each
  // Closest hits: bits of t above the triangle's index, so that the least is the nearest, and of
  // those the lowest index.
  unsigned long long best[kWarp];
  unsigned long long index[kWarp];  // of the lane's ray
  uint2 queue[2 * kWarp];           // a ring: leaf triangle, lane
  unsigned blocked;                 // any-hit: bit of each lane whose ray hit something
};

// A lane's ray, where the others find it.
__device__ OCTRACE_FORCE_INLINE void publish(WarpShared& shared, unsigned lane, const Ray& ray,
                                             const SlabRay& slab_ray) {
  const TriangleRay t = make_triangle_ray(ray.direction);
  shared.ray[0][lane] = make_float4(ray.origin.x, ray.origin.y, ray.origin.z, ray.tmin);
  shared.ray[1][lane] = make_float4(t.row_x.x, t.row_x.y, t.row_x.z, t.row_z.x);
  shared.ray[2][lane] = make_float4(t.row_y.x, t.row_y.y, t.row_y.z, t.row_z.y);
  shared.ray[3][lane] =
      make_float4(slab_ray.inverse.x, slab_ray.inverse.y, slab_ray.inverse.z, t.row_z.z);
  shared.best[lane] = static_cast<unsigned long long>(__float_as_uint(ray.tmax)) << 32 | kNone;
  shared.hit[lane] = make_float4(ray.tmax, 0.0f, 0.0f, __uint_as_float(kNone));
}

// Tests the first `count` pairs of the queue, one a lane.
template <bool kAnyHit, bool kAlpha>
__device__ OCTRACE_FORCE_INLINE void test_pairs(const SceneView& scene, const RenderParams& params,
                                                WarpShared& shared, unsigned lane, unsigned first,
                                                unsigned count) {
  __syncwarp();
  bool found = false;
  unsigned owner = 0;
  TriangleHit hit;
  unsigned long long key = 0;
  std::uint32_t index = 0;
  if (lane < count) {
    const uint2 pair = shared.queue[(first + lane) % (2 * kWarp)];
    owner = pair.y;
    const LeafTriangle triangle = load(scene.octree.triangles[pair.x]);
    const float4 r0 = shared.ray[0][owner], r1 = shared.ray[1][owner], r2 = shared.ray[2][owner],
                 r3 = shared.ray[3][owner];
    const SlabRay slab_ray{Vec3(r0.x, r0.y, r0.z), 0, Vec3(r3.x, r3.y, r3.z)};
    const TriangleRay triangle_ray{Vec3(r1.x, r1.y, r1.z), Vec3(r2.x, r2.y, r2.z),
                                   Vec3(r1.w, r2.w, r3.w)};
    const float tmax = __uint_as_float(static_cast<std::uint32_t>(shared.best[owner] >> 32));
    const bool cull = !kAnyHit && culls_back(triangle, params);
    index = triangle.triangle;
    found = intersect_triangle(slab_ray, triangle_ray, triangle.a, triangle.b, triangle.c, r0.w,
                               tmax, cull, &hit) &&
            (!kAlpha || (triangle.flags & kAlphaTest) == 0 || params.alpha == 0 ||
             alpha_passes(scene, triangle.geometry, index, hit.u, hit.v));
    if (found) {
      if constexpr (kAnyHit) {
        atomicOr(&shared.blocked, 1u << owner);
      } else {
        key = static_cast<unsigned long long>(__float_as_uint(hit.t)) << 32 | index;
        atomicMin(&shared.best[owner], key);
      }
    }
  }
  __syncwarp();
  if constexpr (!kAnyHit) {
    if (found && shared.best[owner] == key) {
      shared.hit[owner] = make_float4(hit.t, hit.u, hit.v, __uint_as_float(index));
    }
    __syncwarp();
  }
}

// The n-th of the lanes that are set in `lanes`, counted below this one.
__device__ OCTRACE_FORCE_INLINE unsigned rank(unsigned lanes, unsigned lane) {
  return __popc(lanes & ((1u << lane) - 1u));
}

// One atomic for all idle lanes of a warp.
__device__ OCTRACE_FORCE_INLINE std::uint64_t take_rays(unsigned idle, unsigned lane,
                                                        unsigned long long* next) {
  unsigned long long first = 0;
  const unsigned leader = __ffs(static_cast<int>(idle)) - 1;
  if (lane == leader) first = atomicAdd(next, __popc(idle));
  first = __shfl_sync(kAllLanes, first, leader);
  return first + rank(idle, lane);
}

// Source: count(); load(index) -> Ray; store(index, Hit) once for each.
template <bool kAnyHit, int kRefill, class Source>
__device__ OCTRACE_FORCE_INLINE void trace_rays(const SceneView& scene, const RenderParams& params,
                                                const Source& source, WarpShared& shared,
                                                const VisitOrder& visit_order, Report* report) {
  const unsigned lane = threadIdx.x % kWarp;
  BoxRay ray;
  float tmin = 0.0f, tmax = 0.0f;
  WalkStack stack;
  WalkGroup group{0, 0};
  int depth = 0;
  std::uint32_t budget = 0;
  bool live = false, holds = false, more = true;
  unsigned first_pair = 0, pairs = 0;
  const auto fail = [&](TraceStatus status) {
    report_failure(report, status, static_cast<std::uint32_t>(shared.index[lane]), 0);
    live = false;
  };
  if (kAnyHit && lane == 0) shared.blocked = 0;
  __syncwarp();
  for (;;) {
    // The queue is empty here, so rays whose walk is over are done.
    if (holds && !live) {
      float4 hit;
      if constexpr (kAnyHit) {
        const bool blocked = shared.blocked >> lane & 1u;
        hit = shared.hit[lane];
        if (blocked) hit.w = __uint_as_float(0);
      } else {
        hit = shared.hit[lane];
      }
      source.store(shared.index[lane], Hit{hit.x, hit.y, hit.z, __float_as_uint(hit.w)});
      holds = false;
    }
    if (more) {
      const unsigned idle = __ballot_sync(kAllLanes, !holds);
      const std::uint64_t taken = take_rays(idle, lane, &report->next_ray);
      if constexpr (kAnyHit) {
        if (lane == 0) shared.blocked &= ~idle;
      }
      if (!holds && taken < source.count()) {
        shared.index[lane] = taken;
        const Ray from = source.load(taken);
        const SlabRay slab_ray = make_slab_ray(from);
        publish(shared, lane, from, slab_ray);
        if (!scene.octree.nodes.empty()) ray = make_box_ray(slab_ray, scene.octree.nodes.data);
        tmin = from.tmin;
        tmax = from.tmax;
        // The root, as the child in slot 0 of nothing.
        group = {0, (1u << (24 + (ray.octant ^ 7u))) | 1u};
        depth = 0;
        budget = static_cast<std::uint32_t>(scene.octree.nodes.size) + 1;
        holds = true;
        live = budget != 1;
      }
      more = __all_sync(kAllLanes, holds);
    }
    unsigned living = __ballot_sync(kAllLanes, live);
    if (!__any_sync(kAllLanes, holds)) return;
    const int refill = more ? kRefill : 1;
    while (__popc(living) >= refill) {
      std::uint32_t first_triangle = 0, triangles = 0;
      if (live) {
        const int bit = highest_bit(group.pending);
        const std::uint32_t slot = (static_cast<std::uint32_t>(bit) ^ ray.octant ^ 7u) & 7u;
        const std::uint32_t before = group.pending & 0xffu & ((1u << slot) - 1u);
        const ChildMask children = ChildTest::test(
            scene.octree.nodes[group.first_child + count_bits(before)], ray, tmin, tmax);
        group.pending &= ~(1u << bit);
        const std::uint32_t inner = children.hit & children.inner_mask;
        if (inner != 0) {
          if (group.pending & kInnerBits) {
            if (depth == kMaxDepth) {
              fail(TraceStatus::stack_overflow);
            } else {
              stack[depth++] = group;
            }
          }
          group = {children.first_child,
                   static_cast<std::uint32_t>(visit_order.order[ray.octant][inner]) << 24 |
                       children.inner_mask};
        } else if (!(group.pending & kInnerBits)) {
          if (depth == 0) {
            live = false;
          } else {
            group = stack[--depth];
          }
        }
        if (--budget == 0 && live) fail(TraceStatus::step_budget);
        first_triangle = children.first_triangle;
        for (std::uint32_t leaves = children.hit & ~children.inner_mask; leaves != 0;
             leaves &= leaves - 1) {
          const std::uint32_t meta =
              __byte_perm(children.meta[0], children.meta[1], lowest_bit(leaves)) & 0xffu;
          triangles |= (meta >> 5) << (meta & 31u);
        }
      }
      for (;;) {
        const unsigned having = __ballot_sync(kAllLanes, triangles != 0);
        if (having == 0) break;
        if (triangles != 0) {
          const unsigned at = first_pair + pairs + rank(having, lane);
          shared.queue[at % (2 * kWarp)] =
              make_uint2(first_triangle + static_cast<unsigned>(lowest_bit(triangles)), lane);
          triangles &= triangles - 1;
        }
        pairs += __popc(having);
        if (pairs >= kWarp) {
          test_pairs<kAnyHit, Source::kAlpha>(scene, params, shared, lane, first_pair, kWarp);
          pairs -= kWarp;
          first_pair += kWarp;
          if constexpr (kAnyHit) {
            if (shared.blocked >> lane & 1u) {
              live = false;
              triangles = 0;
            }
          } else {
            tmax = __uint_as_float(static_cast<std::uint32_t>(shared.best[lane] >> 32));
          }
        }
      }
      living = __ballot_sync(kAllLanes, live);
    }
    if (pairs != 0) {
      test_pairs<kAnyHit, Source::kAlpha>(scene, params, shared, lane, first_pair, pairs);
      first_pair += pairs;
      pairs = 0;
      if constexpr (kAnyHit) {
        if (shared.blocked >> lane & 1u) live = false;
      } else {
        tmax = __uint_as_float(static_cast<std::uint32_t>(shared.best[lane] >> 32));
      }
    }
  }
}

}  // namespace octrace::kernels::cuda
