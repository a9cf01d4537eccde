// The top of the binary tree, down to ranges of references that one thread builds in its cache.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/octree/binary_tree.h"
#include "backend/octree/loose_split.h"

namespace octrace::octree {

// The most references of a subtree: 256 KiB of them, and twice as much of binary nodes, stay in a
// core's caches while they are worked on.
inline constexpr std::uint32_t kMostInSubtree = 8192;

struct TopOptions {
  int bins = 16;
  int sah_depth = 64;  // binary levels; below that, ranges are halved by rank
};

// References [first, first + count), which are to be leaf triangles of the same numbers.
struct TopRange {
  std::uint32_t first = 0, count = 0;
  int depth = 0;
  Bounds8 bounds;
  std::uint32_t subtree = 0;               // its number, where it is not split
  std::unique_ptr<TopRange> lower, upper;  // both or none
};

struct TopTree {
  std::unique_ptr<TopRange> root;
  std::vector<const TopRange*> subtrees;  // in order of their references
  // How far sides of splits reach into each other: the most surface that two of them share, less
  // the faces that any two neighbours share, as part of the root's. Large triangles among small
  // ones make it large.
  float overlap = 0.0f;
};

// Makes the references of all triangles and sorts them into ranges. The same for any number of
// threads. Needs at least one triangle.
TopTree split_top(const BuildInput& input, const TopOptions& options, LooseReference* references);

struct LocalTriangle {
  Corners corners;
  std::uint32_t triangle;
};

// Room in which one thread builds subtrees.
class SubtreeRoom {
 public:
  SubtreeRoom();

  // The binary tree over the range, whose leaves are single references: its root goes to
  // nodes[root], and its pairs are the count - 1 from first_pair on.
  void build(const TopRange& range, const TopOptions& options, const LooseReference* references,
             BinaryNode* nodes, std::uint32_t first_pair, std::uint32_t root);
  // The same tree by itself, in nodes[kRoot] and the pairs from 1 on. Its leaves name places in
  // `local`, which is filled as well.
  void build(const TopRange& range, const TopOptions& options, const LooseReference* references,
             BinaryNode* nodes, LocalTriangle* local);

 private:
  void build(const TopRange& range, const TopOptions& options, BinaryNode* nodes,
             std::uint32_t first_pair, std::uint32_t root);

  LooseSplitter loose_;
  ObjectSplitter splitter_;
  std::unique_ptr<Reference[]> references_, spare_;
};

// The whole binary tree.
BinaryTree build_below(const TopTree& top, const TopOptions& options,
                       const LooseReference* references);

}  // namespace octrace::octree
