// The tree as builders make it, before it is laid out in memory: nodes encoded, children by
// pointer.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>

#include <tbb/enumerable_thread_specific.h>

#include "backend/octree/box.h"
#include "kernels/node.h"

namespace octrace::octree {

// The triangles of a leaf child are ids[first, first + count) of the array that the builder sorts.
struct TreeNode {
  kernels::Node node;
  std::array<TreeNode*, kernels::kChildren> children{};        // by slot; null: leaf or empty
  std::array<std::uint32_t, kernels::kChildren> leaf_first{};  // by slot
  std::array<std::uint8_t, kernels::kChildren> leaf_count{};   // by slot; 0: no leaf
  std::uint32_t subtree_nodes = 1;                             // this node and all below it
  std::uint32_t subtree_triangles = 0;                         // all leaf triangles below it
  std::uint32_t height = 1;                                    // nodes on the longest path down
};

// Nodes live as long as the arena; threads allocate without waiting for each other.
class TreeArena {
 public:
  TreeNode* allocate() { return &nodes_.local().emplace_back(); }

 private:
  tbb::enumerable_thread_specific<std::deque<TreeNode>> nodes_;
};

// One child as a builder hands it over: an inner node, or a leaf of 1 to kMaxLeafTriangles
// triangles.
struct Child {
  Box box;
  TreeNode* node = nullptr;
  std::uint32_t leaf_first = 0;
  std::uint32_t leaf_count = 0;
};

// Which slot each child goes to, so that visiting slots by (slot ^ octant) runs front to back.
using Slots = std::array<std::uint8_t, kernels::kChildren>;
Slots slots_by_octant(std::span<const Child> children, const Box& parent);

// A node's frame, and its children's boxes rounded outwards into it.
void quantise(std::span<const Child> children, const Slots& slots, kernels::Node& node);

// Fills a TreeNode: quantises the boxes outwards and sums up the subtree.
void encode(std::span<const Child> children, const Slots& slots, TreeNode& node);

}  // namespace octrace::octree
