// The octree as the CPU's SIMD walks read it: the same tree with the children's boxes as floats and
// the leaf triangles a row an axis, so that no instruction is spent on unpacking. Nodes and leaves
// lie in one array of 64-byte units, a node's leaves behind it; derived from the 80-byte nodes,
// which stay what is built, verified and sent to GPUs. docs/performance.md says what it gains.
//
// Boxes: the walk pads a child's planes by 2^-19 * B, where B bounds the distance M along an axis
// from the ray's origin to the farthest plane of the child's box. The interval of a triangle's own
// box, which box.h widens by 2^-20 * M, lies within the child's: the roundings in between are below
// 8 * 2^-24 * M, and what is lost by the product of origin and inverse direction is below 2^-22 of
// that product, which the walk adds. B = t * |d| + extent, where t is where the ray enters the
// node's own box (so a point of the ray there lies within that padded box), |d| the largest
// component of the direction and extent the node's longest side, but at least 2^-10 of its
// parent's: then the parent's padding, by which that point may stray, is below 2^-8 of B. The
// planes hold their share of extent already.
//
// A triangle that the builder cut lies in the leaves of its parts, whose boxes here hold those that
// backend/octree/spatial_split.h gave the parts, with its margin for hits; of a part, M is less
// than that of the whole triangle by at most the triangle's longest side, which the margin covers.
#pragma once

#include "kernels/node.h"

namespace octrace::kernels {

inline constexpr std::uint32_t kWideLanes = 8;  // triangles in a leaf, at most

// What a child is. Inner: its node's unit. Leaf: kLeafRef | (triangles - 1) << 28 | first unit.
using WideRef = std::uint32_t;
inline constexpr WideRef kLeafRef = 1u << 31;
inline constexpr WideRef kDoneRef = 1u << 30;  // the bottom of a stack
inline constexpr std::uint32_t kMaxWideUnits = 1u << 28;

OCTRACE_FORCE_INLINE std::uint32_t leaf_count(WideRef leaf) { return ((leaf >> 28) & 7u) + 1; }

struct alignas(64) WideUnit {
  float words[16];
};

struct alignas(64) WideNode {
  float planes[3][2][8];  // by axis, lower or upper, slot
  // Unused slots have an empty box and name a leaf of no extent all the same, because the box test
  // of a direction along an axis may overflow and pass: testing a triangle too many never changes a
  // hit.
  WideRef child[8];
  std::uint32_t unused[8];
};
inline constexpr std::uint32_t kNodeUnits = 4;
static_assert(sizeof(WideNode) == kNodeUnits * sizeof(WideUnit));

// Rows of a leaf, each of as many words as the leaf has triangles: a.x a.y a.z b.x .. c.z, index of
// the scene's triangle, flags, reach. No point of the leaf's box or of the triangle is farther
// along an axis from another one than the reach.
inline constexpr std::uint32_t kLeafRows = 12;
enum LeafRow : std::uint32_t { kRowTriangle = 9, kRowFlags = 10, kRowReach = 11 };

struct WideView {
  const WideUnit* units = nullptr;  // the root is unit 0; null: walk the 80-byte nodes instead
  Vec3 lower, upper;                // the root's box

  bool empty() const { return units == nullptr; }
  OCTRACE_FORCE_INLINE const WideUnit* at(WideRef ref) const {
    return units + (ref & (kMaxWideUnits - 1));
  }
  OCTRACE_FORCE_INLINE const WideNode& node(WideRef ref) const {
    return *reinterpret_cast<const WideNode*>(at(ref));
  }
  OCTRACE_FORCE_INLINE const float* leaf(WideRef ref) const { return at(ref)->words; }
};

}  // namespace octrace::kernels
