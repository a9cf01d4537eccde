// The octree's node: eight children with tight boxes, quantised to 8 bits an axis, in 80 bytes
// (Ylitie, Karras, Laine 2017, "Efficient incoherent ray traversal on GPUs through compressed wide
// BVHs", whose layout serves any eight-way tree). Every builder and every device uses this node.
#pragma once

#include "kernels/config.h"

namespace octrace::kernels {

inline constexpr int kChildren = 8;
// The most triangles that one child slot holds, and one node: a leaf of more becomes a small
// subtree.
inline constexpr int kMaxLeafTriangles = 3;
inline constexpr int kMaxNodeTriangles = kChildren * kMaxLeafTriangles;
// Builders stop at this depth (nodes on a path from the root). The traversal pushes at most one
// group of siblings a level, so a stack of kMaxDepth entries cannot overflow.
inline constexpr int kMaxDepth = 32;

// Child slots are assigned so that visiting slots s in the order of (s ^ octant), where bit a of
// octant is set when the ray's direction is negative along axis a, goes roughly from near to far.
//
// A child's box along axis a is [origin[a] + lower[a][slot] * 2^exponent[a],
// origin[a] + upper[a][slot] * 2^exponent[a]]. Unused slots have meta 0.
struct alignas(16) Node {
  float origin[3];
  std::int8_t exponent[3];
  std::uint8_t inner_mask;       // bit s: slot s is an inner node
  std::uint32_t first_child;     // inner children lie together, in slot order
  std::uint32_t first_triangle;  // this node's leaf triangles lie together, in slot order
  // Leaves: bits 0-4 the offset from first_triangle, bits 5-7 as many ones as it has triangles
  // (001, 011, 111). Inner nodes: 0x20 | (24 + slot), as in the paper.
  std::uint8_t meta[kChildren];
  std::uint8_t lower[3][kChildren];
  std::uint8_t upper[3][kChildren];
};
static_assert(sizeof(Node) == 80);

// A triangle as the leaf test reads it: corners by value, in the scene's order.
struct alignas(16) LeafTriangle {
  Vec3 a;
  std::uint32_t triangle;  // index into the scene's triangles
  Vec3 b;
  std::uint32_t flags;  // kCullBack, kAlphaTest
  Vec3 c;
  std::uint32_t geometry;  // index into the scene's geometries
};
static_assert(sizeof(LeafTriangle) == 48);

// One load of 16 bytes a corner, where the compiler would make one of each member.
OCTRACE_HD OCTRACE_FORCE_INLINE LeafTriangle load(const LeafTriangle& from) {
#if defined(__CUDA_ARCH__)
  const float4* p = reinterpret_cast<const float4*>(&from);
  const float4 a = __ldg(p), b = __ldg(p + 1), c = __ldg(p + 2);
  return {Vec3(a.x, a.y, a.z),  __float_as_uint(a.w), Vec3(b.x, b.y, b.z),
          __float_as_uint(b.w), Vec3(c.x, c.y, c.z),  __float_as_uint(c.w)};
#else
  return from;
#endif
}

inline constexpr std::uint32_t kCullBack = 1;   // single-sided material
inline constexpr std::uint32_t kAlphaTest = 2;  // alpha mode MASK
inline constexpr std::uint32_t kBlend = 4;      // alpha mode BLEND: shadow rays are dimmed

struct OctreeView {
  Span<Node> nodes;  // the root is node 0; empty: nothing to hit
  Span<LeafTriangle> triangles;
  // Triangles were cut, so that siblings overlap little. Any tree may be walked either way: it only
  // says which is faster on a GPU (kernels/cuda/warp_tracer.h).
  bool cut = false;
};

}  // namespace octrace::kernels
