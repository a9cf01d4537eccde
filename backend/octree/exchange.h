// A split in place: what lies in one half of a range and belongs to the other changes places with
// as many references there.
#pragma once

#include <cstdint>
#include <vector>

#include "backend/octree/loose_split.h"

namespace octrace::octree {

// One side of a split before its strangers have left it.
class Half {
 public:
  Half(LooseReference* references, std::uint32_t count, bool upper)
      : references_(references), count_(count), upper_(upper) {}

  // Finds the strangers, and numbers them in their order. Threads write the notes of their own
  // blocks' references.
  void search(const LooseSplitter& splitter, const SidePlane& plane);

  std::uint32_t misplaced() const { return first_number_.back(); }
  // Of what is in this half and belongs to a side.
  const Bounds8& bounds(int side) const { return bounds_[side]; }

  // A block has the strangers [first_number(block), first_number(block + 1)).
  std::uint32_t blocks() const { return static_cast<std::uint32_t>(first_number_.size() - 1); }
  std::uint32_t first_number(std::uint32_t block) const { return first_number_[block]; }
  std::uint32_t block_of(std::uint32_t number) const;
  // The i-th stranger of a block.
  LooseReference& in_block(std::uint32_t block, std::uint32_t i) const;

 private:
  LooseReference* references_;
  std::uint32_t count_;
  bool upper_;
  std::vector<std::uint32_t> first_number_;  // by block, and the sum
  Bounds8 bounds_[2];
};

// The k-th stranger of one half and the k-th of the other change places; notes stay. The halves
// have equally many.
void exchange(const Half& lower, const Half& upper);
// The part of that which falls to a block of the lower half: other threads may do other blocks'.
void exchange_block(const Half& lower, const Half& upper, std::uint32_t block);

}  // namespace octrace::octree
