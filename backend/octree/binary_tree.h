// The binary tree that the SAH builders make and improve before it is collapsed into eight-way
// nodes, and the references that it is made of.
#pragma once

#include <cstdint>
#include <limits>

#include "backend/octree/box.h"
#include "backend/octree/octree.h"
#include "backend/util/huge_vector.h"

namespace octrace::octree {

// The box of a triangle, or of a part of one. The upper corner is negated, so that one minimum of
// eight floats joins two boxes.
struct alignas(32) Reference {
  float lower[3];
  std::uint32_t triangle;
  float negated_upper[3];
  std::uint32_t part;  // 1: of a part of the triangle

  float upper(int axis) const { return -negated_upper[axis]; }
  // Twice the centre: a sum rounds once, and builders only compare centres.
  float centre2(int axis) const { return lower[axis] - negated_upper[axis]; }
};
static_assert(sizeof(Reference) == 32);

// What a leaf triangle is made of.
struct alignas(16) Corners {
  std::uint32_t a, b, c;  // positions
  std::uint32_t geometry;
};

// A reference at the place of a leaf triangle: references without parts are kept in the memory of
// the leaf triangles to come, which would lie idle while the tree is made, and each range of them
// in that of its own triangles.
struct alignas(16) LooseReference {
  float lower[3];
  std::uint32_t triangle;
  float negated_upper[3];
  std::uint32_t note;  // for whoever splits
  Corners corners;

  float centre2(int axis) const { return lower[axis] - negated_upper[axis]; }
};
static_assert(sizeof(LooseReference) == sizeof(kernels::LeafTriangle));

// The bounds of references and of their centres, laid out like a Reference; words 3 and 7 mean
// nothing.
struct alignas(32) Bounds8 {
  float box[8];
  float centres[8];

  Bounds8() {
    for (int i = 0; i < 8; ++i) box[i] = centres[i] = std::numeric_limits<float>::infinity();
  }
  float lower(int axis) const { return box[axis]; }
  float upper(int axis) const { return -box[4 + axis]; }
  float half_area() const {
    const float x = upper(0) - lower(0), y = upper(1) - lower(1), z = upper(2) - lower(2);
    return x * y + y * z + z * x;
  }
};

// 32 bytes, so that a pair of siblings fills one line of a cache.
struct BinaryNode {
  static constexpr std::uint32_t kLeaf = 1u << 31;

  float lower[3];
  std::uint32_t child;  // the pair of children, or kLeaf | triangle
  float upper[3];
  std::uint32_t plan;  // as built: references below; plan.cpp keeps its decisions here

  bool leaf() const { return (child & kLeaf) != 0; }
  std::uint32_t triangle() const { return child & ~kLeaf; }
  float half_area() const {
    const float x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
    return x * y + y * z + z * x;
  }
};
static_assert(sizeof(BinaryNode) == 32);

// Walks down a whole tree wait for memory, unless children are asked for while others are at work.
inline void ask_for_children(const BinaryNode* nodes, const BinaryNode& node) {
  if (!node.leaf()) __builtin_prefetch(&nodes[2 * std::uint64_t{node.child}]);
}

// Pair p is nodes[2 * p] and nodes[2 * p + 1]; the root is nodes[kRoot]. Builders give every range
// of references its own pairs, so threads share nothing and the numbers do not depend on them; some
// pairs stay unused and uninitialised.
struct BinaryTree {
  static constexpr std::uint32_t kRoot = 1;
  util::HugeVector<BinaryNode> nodes;
};

}  // namespace octrace::octree
