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
// Records of the queue are what node steps find, up to 24 triangles each; only when they are tested
// are they spread over lanes, 32 at a time.
//
// A ray's tmax shrinks a few node steps late, which costs some nodes but changes no hit: the least
// (t, triangle) wins, in whatever order it is found.
#pragma once

#include "kernels/cuda/box_ray.h"
#include "kernels/cuda/tracer.h"

namespace octrace::kernels::cuda {

inline constexpr unsigned kWarp = 32;
inline constexpr unsigned kAllLanes = 0xffffffffu;

// What the warps of a block share.
struct BlockShared {
  std::uint8_t order[8][256];  // [octant][mask]: bit s of mask at bit s ^ octant ^ 7

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
  // A ring of what node steps found: first_triangle, the meta bytes of the leaves that the ray met
  // (0: not met), lane. Every record has at least one triangle.
  uint4 queue[2 * kWarp];
  unsigned blocked;  // any-hit: bit of each lane whose ray hit something
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

#if __CUDA_ARCH__ >= 800
__device__ OCTRACE_FORCE_INLINE unsigned reduce_or(unsigned x) {
  return __reduce_or_sync(kAllLanes, x);
}
__device__ OCTRACE_FORCE_INLINE unsigned reduce_add(unsigned x) {
  return __reduce_add_sync(kAllLanes, x);
}
#else
__device__ OCTRACE_FORCE_INLINE unsigned reduce_or(unsigned x) {
  for (unsigned step = 1; step < kWarp; step *= 2) x |= __shfl_xor_sync(kAllLanes, x, step);
  return x;
}
__device__ OCTRACE_FORCE_INLINE unsigned reduce_add(unsigned x) {
  for (unsigned step = 1; step < kWarp; step *= 2) x += __shfl_xor_sync(kAllLanes, x, step);
  return x;
}
#endif

// The n-th of the lanes that are set in `lanes`, counted below this one.
__device__ OCTRACE_FORCE_INLINE unsigned rank(unsigned lanes, unsigned lane) {
  return __popc(lanes & ((1u << lane) - 1u));
}

// Four bits to four bytes of 0 or 0xff.
__device__ OCTRACE_FORCE_INLINE std::uint32_t spread_bits(std::uint32_t bits) {
  return ((bits * 0x00204081u) & 0x01010101u) * 0xffu;
}

// Of the meta bytes of four children, one bit for each triangle.
__device__ OCTRACE_FORCE_INLINE std::uint32_t triangle_bits(std::uint32_t meta) {
  return meta & 0xe0e0e0e0u;
}

__device__ OCTRACE_FORCE_INLINE unsigned count_triangles(const uint4& record) {
  return __popc(triangle_bits(record.y) | triangle_bits(record.z) >> 3);
}

// A value that is kept in a register: the compiler would rather read special registers again in
// each node step, and wait for them.
__device__ OCTRACE_FORCE_INLINE std::uint32_t kept(std::uint32_t value) {
  asm volatile("" : "+r"(value));
  return value;
}

// The k-th triangle of a record.
__device__ OCTRACE_FORCE_INLINE std::uint32_t triangle_of(const uint4& record, unsigned k) {
  std::uint32_t meta = record.y, bits = triangle_bits(record.y);
  const unsigned lower = __popc(bits);
  if (k >= lower) {
    k -= lower;
    meta = record.z;
    bits = triangle_bits(record.z);
  }
  for (; k != 0; --k) bits &= bits - 1;
  const unsigned bit = static_cast<unsigned>(lowest_bit(bits));
  return record.x + ((meta >> (bit & 24u)) & 31u) + (bit & 7u) - 5u;
}

// The queue's state, the same in all lanes.
struct Queue {
  unsigned first = 0;    // of the ring
  unsigned records = 0;  // at most kWarp between node steps
  unsigned skipped = 0;  // triangles of the first record that were tested already
  unsigned pairs = 0;    // triangles that wait
};

// Takes the first `count` pairs, one for each lane below count, and returns that lane's: record and
// number of the triangle in it. count: the lesser of kWarp and queue.pairs.
__device__ OCTRACE_FORCE_INLINE uint4 take_pair(WarpShared& shared, Queue& queue, unsigned lane,
                                                unsigned count, unsigned* number) {
  __syncwarp();
  unsigned triangles = 0;
  if (lane < queue.records) {
    triangles = count_triangles(shared.queue[(queue.first + lane) % (2 * kWarp)]);
  }
  if (lane == 0) triangles -= queue.skipped;
  unsigned end = triangles;
#pragma unroll
  for (unsigned step = 1; step < kWarp; step *= 2) {
    const unsigned below = __shfl_up_sync(kAllLanes, end, step);
    if (lane >= step) end += below;
  }
  const unsigned start = end - triangles;
  // Bit i: a record's first pair goes to lane i.
  const unsigned starts = reduce_or(triangles != 0 && start < kWarp ? 1u << start : 0u);
  const unsigned mine = starts & (kAllLanes >> (kWarp - 1 - lane));
  const unsigned record = __popc(mine) - 1;
  *number = lane - static_cast<unsigned>(highest_bit(mine)) + (record == 0 ? queue.skipped : 0);
  const uint4 taken = shared.queue[(queue.first + record) % (2 * kWarp)];
  const unsigned last = __popc(starts) - 1;
  const unsigned ended = __ballot_sync(kAllLanes, lane <= last && end <= count);
  const unsigned done = __popc(ended);
  const unsigned left = count - static_cast<unsigned>(highest_bit(starts));
  queue.skipped = done > last ? 0 : left + (last == 0 ? queue.skipped : 0);
  queue.first += done;
  queue.records -= done;
  queue.pairs -= count;
  return taken;
}

// Tests the first pairs of the queue, one a lane.
template <bool kAnyHit, bool kAlpha>
__device__ OCTRACE_FORCE_INLINE void test_pairs(const SceneView& scene, const RenderParams& params,
                                                WarpShared& shared, Queue& queue, unsigned lane) {
  const unsigned count = min(queue.pairs, kWarp);
  unsigned number;
  const uint4 record = take_pair(shared, queue, lane, count, &number);
  bool found = false;
  const unsigned owner = record.w;
  TriangleHit hit;
  unsigned long long key = 0;
  std::uint32_t index = 0;
  if (lane < count) {
    const LeafTriangle triangle = load(scene.octree.triangles[triangle_of(record, number)]);
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

// One atomic for all idle lanes of a warp.
__device__ OCTRACE_FORCE_INLINE std::uint64_t take_rays(unsigned idle, unsigned lane,
                                                        unsigned long long* next) {
  unsigned long long first = 0;
  const unsigned leader = __ffs(static_cast<int>(idle)) - 1;
  if (lane == leader) first = atomicAdd(next, __popc(idle));
  first = __shfl_sync(kAllLanes, first, leader);
  return first + rank(idle, lane);
}

// Between the children to visit and inner_mask, a group has the upper half of a float: a distance
// before any of its children but the nearest is entered. It is at least 0, so that cutting off the
// lower half rounds it down.
inline constexpr std::uint32_t kBoundBits = 0x00ffff00u;

__device__ OCTRACE_FORCE_INLINE float bound_of(const WalkGroup& group) {
  return __uint_as_float(group.pending << 8 & 0xffff0000u);
}

// kOrder: a node's children are visited by the ray's octant, but for the one that the ray enters
// first, which comes first; and the others are passed over without a visit once the hit is nearer
// than all of them. That takes 30 more instructions a node. It pays where siblings do not overlap
// (OctreeView::cut): half of the nodes in sponza; in other trees it saves a tenth.
//
// Source: count(); load(index) -> Ray; prefetch(index), a hint before that index is loaded;
// store(index, Hit) once for each; kAlpha, whether alpha masks count.
template <bool kAnyHit, bool kOrder, int kRefill, class Source>
__device__ OCTRACE_FORCE_INLINE void trace_rays(const SceneView& scene, const RenderParams& params,
                                                const Source& source, WarpShared& shared,
                                                const BlockShared& block, Report* report) {
  const unsigned lane = kept(threadIdx.x % kWarp);
  const std::uint32_t queue_at =
      kept(static_cast<std::uint32_t>(__cvta_generic_to_shared(shared.queue)));
  const std::uint32_t order_base =
      static_cast<std::uint32_t>(__cvta_generic_to_shared(&block.order[0][0]));
  std::uint32_t order_at = 0;
  BoxRay ray;
  std::uint32_t octant = 0;  // bit a: the ray's direction is negative along axis a
  float tmax = 0.0f;
  WalkStack stack;
  WalkGroup group{0, 0};
  int next = 0;  // kOrder: the bit of the group's child that comes next
  int depth = 0;
  std::uint32_t budget = 0;
  bool live = false, holds = false, more = true;
  Queue queue;
  const auto fail = [&](TraceStatus status) {
    report_failure(report, status, static_cast<std::uint32_t>(shared.index[lane]), 0);
    live = false;
  };
  const auto test = [&] {
    test_pairs<kAnyHit, Source::kAlpha>(scene, params, shared, queue, lane);
    if constexpr (kAnyHit) {
      if (shared.blocked >> lane & 1u) live = false;
    } else {
      tmax = __uint_as_float(static_cast<std::uint32_t>(shared.best[lane] >> 32));
    }
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
        source.prefetch(taken);
        const Ray from = source.load(taken);
        const SlabRay slab_ray = make_slab_ray(from);
        publish(shared, lane, from, slab_ray);
        if (!scene.octree.nodes.empty()) ray = make_box_ray(slab_ray, scene.octree.nodes.data);
        octant = slab_ray.octant;
        order_at = kept(order_base + 256 * octant);
        tmax = from.tmax;
        // The root, as the child in slot 0 of nothing.
        group = {0, (1u << (24 + (octant ^ 7u))) | 1u};
        next = highest_bit(group.pending);
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
      uint4 found = make_uint4(0, 0, 0, lane);
      if (live) {
        const int bit = kOrder ? next : highest_bit(group.pending);
        const std::uint32_t slot = (static_cast<std::uint32_t>(bit) ^ octant ^ 7u) & 7u;
        const std::uint32_t before = group.pending & 0xffu & ((1u << slot) - 1u);
        const ChildMask children = ChildTest::test<kOrder>(
            scene.octree.nodes[group.first_child + count_bits(before)], ray, tmax);
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
          std::uint32_t ordered;
          asm volatile("ld.shared.u8 %0, [%1];" : "=r"(ordered) : "r"(order_at + inner));
          group = {children.first_child, ordered << 24 | children.inner_mask};
          if constexpr (kOrder) {
            group.pending |= __float_as_uint(children.others) >> 8 & kBoundBits;
            next = static_cast<int>(24u + (children.nearest ^ octant ^ 7u));
          }
        } else if constexpr (kOrder) {
          while (!(group.pending & kInnerBits) || bound_of(group) > tmax) {
            if (depth == 0) {
              live = false;
              break;
            }
            group = stack[--depth];
          }
          next = highest_bit(group.pending);
        } else if (!(group.pending & kInnerBits)) {
          if (depth == 0) {
            live = false;
          } else {
            group = stack[--depth];
          }
        }
        if (--budget == 0 && live) fail(TraceStatus::step_budget);
        const std::uint32_t leaves = children.hit & ~children.inner_mask;
        found.x = children.first_triangle;
        found.y = children.meta[0] & spread_bits(leaves & 15u);
        found.z = children.meta[1] & spread_bits(leaves >> 4);
      }
      const unsigned finders = __ballot_sync(kAllLanes, (found.y | found.z) != 0);
      if (finders != 0) {
        if ((found.y | found.z) != 0) {
          const unsigned at = (queue.first + queue.records + rank(finders, lane)) % (2 * kWarp);
          asm volatile("st.shared.v4.u32 [%0], {%1, %2, %3, %4};"
                       :
                       : "r"(queue_at + at * 16), "r"(found.x), "r"(found.y), "r"(found.z),
                         "r"(found.w)
                       : "memory");
        }
        queue.records += __popc(finders);
        queue.pairs += reduce_add(count_triangles(found));
        while (queue.pairs >= kWarp) test();
      }
      living = __ballot_sync(kAllLanes, live);
    }
    // A second copy of the test: one loop with both conditions was 6 % slower.
    if (queue.pairs != 0) test();
  }
}

}  // namespace octrace::kernels::cuda
