// The top of the binary tree, down to units of references; and what one thread builds of it in its
// cache.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/octree/binary_tree.h"
#include "backend/octree/loose_cut.h"

namespace octrace::octree {

// The most references of a unit, which are split no further together.
inline constexpr std::uint32_t kMostInUnit = 1024;
// The most of a subtree, which one thread builds of several units: its binary nodes, 64 bytes a
// reference, are to stay in a core's cache while they are worked on.
inline constexpr std::uint32_t kMostInSubtree = 8192;

// Nodes that one search of a re-insertion looks at: more make no better trees of real scenes, and
// take long where triangles are as large as the scene.
inline constexpr std::uint32_t kReinsertSteps = 256;

struct TopOptions {
  // Scenes of so many triangles are first split by the cells of a grid (top_cells.h), at most one
  // for so many triangles and so many in all, lest they leave the caches; as long as ranges are so
  // many cells wide along their longest axis.
  std::uint32_t least_for_cells = 1u << 17;
  std::uint32_t triangles_a_cell = 8;
  std::uint32_t most_cells = 1u << 17;
  int least_cells = 8;
  int bins = 32;       // of ranges above units
  int unit_bins = 16;  // and in them
  int sah_depth = 64;  // binary levels; below that, ranges are halved by rank
  // Triangles are cut where the sides of a split would reach into each other by more than this part
  // of the root's surface (ObjectSplit::overlap). Parts add at most this share of the triangles.
  // Cuts are no longer tried below so many nodes in line that had no use for one.
  int spatial_bins = 32;
  float least_overlap = 0.01f;
  float duplicates = 0.1f;  // 0: no cuts
  int spatial_misses = 3;
  // Re-insertion (reinsert.h): of the largest nodes in each subtree, if they are larger than this
  // part of the root's surface; then of the largest above the subtrees.
  int reinsert_rounds = 6;
  float reinsert_area = 0.003f;
  std::uint32_t reinsert_most = 256;  // in a subtree
  std::uint32_t reinsert_most_above = 4096;
  std::uint32_t reinsert_steps = kReinsertSteps;
};

struct TopRange {
  // Its references in the array are [first, first + count). Where triangles were cut, there are
  // more beside it, which go on to the halves of a range that is split; one that is not is a unit.
  std::uint32_t first = 0, count = 0;
  Parts parts;
  int depth = 0;
  Bounds8 bounds;                          // of the centres, only while it is not split
  std::uint32_t room = 0;                  // how many parts more cuts may make
  int misses = 0;                          // nodes in line above where a cut was of no use
  std::uint32_t place = 0, size = 0;       // where its references are among those of all units
  std::unique_ptr<TopRange> lower, upper;  // both or none
};

// Depth and room of the halves of a range, whose counts are known.
void hand_down(TopRange& range);

struct TopTree {
  std::unique_ptr<TopRange> root;
};

// Makes the references of all triangles and sorts them into units; cuts triangles between units,
// but not in them. The same for any number of threads. Needs at least one triangle.
TopTree split_top(const BuildInput& input, const TopOptions& options, LooseReference* references);

struct LocalTriangle {
  Corners corners;
  std::uint32_t triangle;
};

// Room in which one thread builds subtrees.
class SubtreeRoom {
 public:
  SubtreeRoom();

  // The binary tree over the range, of at most kMostInSubtree references, in nodes[kRoot] and the
  // pairs from 1 on. Its leaves are single references and name places in `local`, which is filled
  // as well.
  void build(const TopRange& range, const TopOptions& options, const LooseReference* references,
             BinaryNode* nodes, LocalTriangle* local);

 private:
  struct Work {
    const TopOptions& options;
    const LooseReference* references;
    std::uint32_t base;  // the place of the range's first reference
    BinaryNode* nodes;
    LocalTriangle* local;
  };
  void build(const Work& work, const TopRange& range, std::uint32_t root);
  void build_unit(const Work& work, const TopRange& unit, std::uint32_t root);

  LooseSplitter loose_;
  ObjectSplitter splitter_;
  std::unique_ptr<Reference[]> references_, spare_;
};

}  // namespace octrace::octree
