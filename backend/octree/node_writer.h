// Eight-way nodes from binary nodes that are planned (plan.h).
#pragma once

#include <array>
#include <cstdint>

#include "backend/octree/top_tree.h"

namespace octrace::octree {

// The children of an eight-way node, as binary nodes.
struct Family {
  std::array<std::uint32_t, kernels::kChildren> index;
  int count = 0;

  Family(const BinaryNode* nodes, std::uint32_t root);

 private:
  void share_out(const BinaryNode* nodes, std::uint32_t root, int slots, bool divided);
};

class NodeWriter {
 public:
  // Where the next nodes and triangles go.
  struct Place {
    std::uint32_t node, triangle;
  };

  // The tree's leaves name the scene's triangles.
  NodeWriter(const BinaryNode* nodes, const BuildInput& input, kernels::Node* to,
             kernels::LeafTriangle* triangles)
      : nodes_(nodes), input_(input), to_(to), triangles_(triangles) {}
  // The same, but the triangles' names alone are written.
  NodeWriter(const BinaryNode* nodes, const BuildInput& input, kernels::Node* to,
             std::uint32_t* names)
      : nodes_(nodes), input_(input), to_(to), names_(names) {}
  // They name elements of `local`.
  NodeWriter(const BinaryNode* nodes, const BuildInput& input, const LocalTriangle* local,
             kernels::Node* to, kernels::LeafTriangle* triangles)
      : nodes_(nodes), input_(input), local_(local), to_(to), triangles_(triangles) {}

  // Writes the node and its leaves' triangles, and leaves room for its inner children, whose places
  // in the family `order` gets. Returns how many they are.
  int write(const Family& family, std::uint32_t index, Place& place,
            std::array<std::uint8_t, kernels::kChildren>& order) const;

  // Writes the node and all below it, depth first: inner children side by side, in the order of
  // slots, and after them what is below each. Returns the nodes on the longest path.
  int write_all(std::uint32_t root, std::uint32_t index, Place& place) const;

 private:
  struct Leaves {
    std::array<std::uint32_t, kernels::kMaxNodeTriangles> triangles;
    std::uint32_t count = 0;
  };

  void gather(std::uint32_t index, Leaves& leaves) const;
  void write_local(const Leaves& leaves, std::uint32_t place) const;

  const BinaryNode* nodes_;
  const BuildInput& input_;
  const LocalTriangle* local_ = nullptr;
  kernels::Node* to_;
  kernels::LeafTriangle* triangles_ = nullptr;
  std::uint32_t* names_ = nullptr;
};

// Writes the leaf triangles of the scene's triangles that are named.
void write_triangles(const BuildInput& input, const std::uint32_t* names, std::uint32_t count,
                     kernels::LeafTriangle* to);

// Moves a subtree, whose root is `from` and whose other nodes follow in places 1 to size - 1, among
// other nodes: its root to `root`, all below to `place` of `nodes`.
void copy_subtree(const kernels::Node* from, std::uint32_t size, kernels::Node* nodes,
                  kernels::Node& root, const NodeWriter::Place& place);

}  // namespace octrace::octree
