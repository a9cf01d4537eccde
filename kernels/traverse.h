// Walks the octree front to back.
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

OCTRACE_HD OCTRACE_FORCE_INLINE ChildHits child_bits(const Node& node, int slot,
                                                     std::uint32_t octant) {
  const std::uint32_t meta = node.meta[slot];
  const bool inner = (node.inner_mask >> slot) & 1;
  return inner ? 1u << (24 + (slot ^ octant ^ 7u)) : (meta >> 5) << (meta & 31u);
}

// The 8-child box test in portable code; kernels/cpu has a SIMD one.
struct ScalarChildTest {
  OCTRACE_HD OCTRACE_FORCE_INLINE ChildHits operator()(const Node& node, const SlabRay& ray,
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
        near = greater(near, (negative ? upper : lower) * step + frame.near[axis]);
        far = lesser(far, (negative ? lower : upper) * step + frame.far[axis]);
      }
      if (near <= far) hits |= child_bits(node, slot, ray.octant);
    }
    return hits;
  }
};

// Calls leaf(index of a leaf triangle, tmax) -> bool for the triangles whose boxes the ray meets
// between ray.tmin and tmax, near children first. The functor lowers tmax when it takes a hit, and
// returns true to end the walk (any-hit queries).
//
// The stack cannot overflow: a push leaves the unvisited siblings of one node, so at most one entry
// a level, and builders stop at kMaxDepth levels. Every node is reached once, so a walk of more
// steps than there are nodes has met a cycle. Both are checked all the same.
template <class ChildTest, class Leaf>
OCTRACE_HD OCTRACE_FORCE_INLINE TraceStatus traverse(const OctreeView& octree, const Ray& ray,
                                                     const SlabRay& slab_ray,
                                                     const ChildTest& child_test, Leaf& leaf) {
  struct Group {
    std::uint32_t first_child;
    std::uint32_t pending;  // bits 24-31: children to visit; bits 0-7: the node's inner_mask
  };
  if (octree.nodes.empty()) return TraceStatus::ok;
  Group stack[kMaxDepth];
  int depth = 0;
  const std::uint32_t flip = slab_ray.octant ^ 7u;
  Group group{0, (1u << (24 + flip)) | 1u};  // the root, as the child in slot 0 of nothing
  float tmax = ray.tmax;
  std::uint64_t budget = octree.nodes.size;
  for (;;) {
    const int bit = highest_bit(group.pending);
    group.pending &= ~(1u << bit);
    const std::uint32_t slot = (static_cast<std::uint32_t>(bit) - 24u) ^ flip;
    const std::uint32_t before = group.pending & 0xffu & ((1u << slot) - 1u);
    const Node& node = octree.nodes[group.first_child + count_bits(before)];
    if (group.pending & kInnerBits) {
      if (depth == kMaxDepth) return TraceStatus::stack_overflow;
      stack[depth++] = group;
    }
    if (budget-- == 0) return TraceStatus::step_budget;
    const ChildHits hits = child_test(node, slab_ray, ray.tmin, tmax);
    group = {node.first_child, (hits & kInnerBits) | node.inner_mask};
    for (std::uint32_t bits = hits & kTriangleBits; bits != 0; bits &= bits - 1) {
      if (leaf(node.first_triangle + lowest_bit(bits), tmax)) return TraceStatus::ok;
    }
    if (!(group.pending & kInnerBits)) {
      if (depth == 0) return TraceStatus::ok;
      group = stack[--depth];
    }
  }
}

}  // namespace octrace::kernels
