// Walks through the octree.
#pragma once

#include "kernels/box.h"
#include "kernels/node.h"
#include "kernels/ray.h"

namespace octrace::kernels {

// Anything but ok means a broken octree; the render fails loudly.
enum class TraceStatus : std::uint32_t { ok, stack_overflow, step_budget };

OCTRACE_HD OCTRACE_FORCE_INLINE int highest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return 31 - __clz(static_cast<int>(bits));
#else
  return 31 - __builtin_clz(bits);
#endif
}

OCTRACE_HD OCTRACE_FORCE_INLINE int lowest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return __ffs(static_cast<int>(bits)) - 1;
#else
  return __builtin_ctz(bits);
#endif
}

OCTRACE_HD OCTRACE_FORCE_INLINE int count_bits(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return __popc(bits);
#else
  return __builtin_popcount(bits);
#endif
}

// What a ray meets in a node: bits 24-31 the inner children, in the order of their visit from the
// highest bit down (bit 24 + (slot ^ octant ^ 7)); bits 0-23 the triangles, from first_triangle.
using ChildHits = std::uint32_t;
inline constexpr ChildHits kInnerBits = 0xff000000u;
inline constexpr ChildHits kTriangleBits = 0x00ffffffu;

// What a child test reads of a node beside its boxes, so that the node is loaded once.
struct NodeVisit {
  ChildHits hits;
  std::uint32_t inner_mask;
  std::uint32_t first_child;
  std::uint32_t first_triangle;
};

OCTRACE_HD OCTRACE_FORCE_INLINE ChildHits child_bits(const Node& node, int slot,
                                                     std::uint32_t octant) {
  const std::uint32_t meta = node.meta[slot];
  const bool inner = (node.inner_mask >> slot) & 1;
  return inner ? 1u << (24 + (slot ^ octant ^ 7u)) : (meta >> 5) << (meta & 31u);
}

// The 8-child box test in plain words; kernels/cpu has a SIMD body of it and kernels/cuda a SIMT
// one.
struct ScalarChildTest {
  OCTRACE_HD OCTRACE_FORCE_INLINE NodeVisit operator()(const Node& node, const SlabRay& ray,
                                                       float tmin, float tmax) const {
    const NodeFrame frame = node_frame(node, ray);
    ChildHits hits = 0;
    for (int slot = 0; slot < kChildren; ++slot) {
      float near = tmin, far = tmax;
      for (int axis = 0; axis < 3; ++axis) {
        const bool negative = (ray.octant >> axis) & 1;
        const float lower = static_cast<float>(node.lower[axis][slot]);
        const float upper = static_cast<float>(node.upper[axis][slot]);
        const float step = frame.step[axis];
        near = greater(near, fma_rn(negative ? upper : lower, step, frame.near[axis]));
        far = lesser(far, fma_rn(negative ? lower : upper, step, frame.far[axis]));
      }
      if (near <= far) hits |= child_bits(node, slot, ray.octant);
    }
    return {hits, node.inner_mask, node.first_child, node.first_triangle};
  }
};

// A walk through the octree, front to back, one node at a time, so that a kernel may pause a ray
// between nodes and take another. next_node() visits a node; the triangles whose boxes the ray
// meets there wait in `triangles`, and are to be taken with next_triangle() before the walk goes
// on.
//
// The stack cannot overflow: a push leaves the unvisited siblings of one node, so at most one entry
// a level, and builders stop at kMaxDepth levels. Every node is reached once, so a walk of more
// steps than there are nodes has met a cycle. Both are checked all the same.
//
// The stack is an array of its own, because an array that is indexed at run time would take the
// walk's other members with it into memory.
struct WalkGroup {
  std::uint32_t first_child;
  std::uint32_t pending;  // bits 24-31: children to visit; bits 0-7: the node's inner_mask
};
using WalkStack = WalkGroup[kMaxDepth];

struct Walk {
  SlabRay ray;
  float tmin, tmax;  // tmax shrinks as hits are found
  WalkGroup group;
  std::uint32_t first_triangle;
  std::uint32_t triangles;  // bits 0-23, from first_triangle
  std::uint32_t budget;
  int depth;
  TraceStatus status;

  OCTRACE_HD OCTRACE_FORCE_INLINE Walk(const OctreeView& octree, const Ray& from) {
    restart(octree, from);
  }

  OCTRACE_HD OCTRACE_FORCE_INLINE void restart(const OctreeView& octree, const Ray& from) {
    ray = make_slab_ray(from);
    tmin = from.tmin;
    tmax = from.tmax;
    // The root, as the child in slot 0 of nothing; nothing to visit in an empty tree.
    group = {0, octree.nodes.empty() ? 0u : (1u << (24 + (ray.octant ^ 7u))) | 1u};
    triangles = 0;
    budget = static_cast<std::uint32_t>(octree.nodes.size);
    depth = 0;
    status = TraceStatus::ok;
  }

  // False: the walk is over, because nothing is left or because status is no longer ok.
  template <class ChildTest>
  OCTRACE_HD OCTRACE_FORCE_INLINE bool next_node(const OctreeView& octree,
                                                 const ChildTest& child_test, WalkStack& stack) {
    if (!(group.pending & kInnerBits)) {
      if (depth == 0) return false;
      group = stack[--depth];
    }
    const int bit = highest_bit(group.pending);
    group.pending &= ~(1u << bit);
    if (group.pending & kInnerBits) {
      if (depth == kMaxDepth) return fail(TraceStatus::stack_overflow);
      stack[depth++] = group;
    }
    if (budget-- == 0) return fail(TraceStatus::step_budget);
    const std::uint32_t slot = (static_cast<std::uint32_t>(bit) - 24u) ^ ray.octant ^ 7u;
    const std::uint32_t before = group.pending & 0xffu & ((1u << slot) - 1u);
    const Node& node = octree.nodes[group.first_child + count_bits(before)];
    const NodeVisit visit = child_test(node, ray, tmin, tmax);
    group = {visit.first_child, (visit.hits & kInnerBits) | visit.inner_mask};
    first_triangle = visit.first_triangle;
    triangles = visit.hits & kTriangleBits;
    return true;
  }

  OCTRACE_HD OCTRACE_FORCE_INLINE std::uint32_t next_triangle() {
    const int bit = lowest_bit(triangles);
    triangles &= triangles - 1;
    return first_triangle + static_cast<std::uint32_t>(bit);
  }

 private:
  OCTRACE_HD bool fail(TraceStatus why) {
    status = why;
    return false;
  }
};

// Calls leaf(index of a leaf triangle, tmax) -> bool for the triangles whose boxes the ray meets.
// The functor lowers tmax when it takes a hit, and returns true to end the walk (any-hit queries).
template <class ChildTest, class Leaf>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus traverse(const OctreeView& octree, Walk& walk,
                                                     const ChildTest& child_test, Leaf& leaf) {
  WalkStack stack;
  while (walk.next_node(octree, child_test, stack)) {
    while (walk.triangles != 0) {
      if (leaf(walk.next_triangle(), walk.tmax)) return TraceStatus::ok;
    }
  }
  return walk.status;
}

}  // namespace octrace::kernels
