#include "backend/octree/exchange.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <utility>

#include "backend/octree/reference_blocks.h"

namespace octrace::octree {

namespace {

// A block's list of strangers is the notes of its first references, which may be strangers too, and
// several threads may take strangers of one block of the upper half: while one exchanges a
// reference, another reads its note. So nobody writes notes here; other members are other memory
// locations, and each stranger has but one thread.
void swap_all_but_notes(LooseReference& a, LooseReference& b) {
  static_assert(sizeof(LooseReference) ==
                2 * sizeof a.lower + sizeof a.triangle + sizeof a.note + sizeof a.corners);
  std::swap(a.lower, b.lower);
  std::swap(a.triangle, b.triangle);
  std::swap(a.negated_upper, b.negated_upper);
  std::swap(a.corners, b.corners);
}

}  // namespace

void Half::search(const LooseSplitter& splitter, const SidePlane& plane) {
  first_number_.assign(blocks_of(count_) + 1, 0);
  std::vector<std::array<Bounds8, 2>> bounds(blocks_of(count_));
  for_blocks(count_, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
    Bounds8 own[2];
    first_number_[block + 1] =
        splitter.find_misplaced(references_ + first, count, upper_, plane, own);
    bounds[block] = {own[0], own[1]};
  });
  for (std::size_t i = 1; i < first_number_.size(); ++i) first_number_[i] += first_number_[i - 1];
  for (const auto& block : bounds) {
    for (int side = 0; side < 2; ++side) bounds_[side] = joined(bounds_[side], block[side]);
  }
}

std::uint32_t Half::block_of(std::uint32_t number) const {
  return static_cast<std::uint32_t>(
      std::upper_bound(first_number_.begin(), first_number_.end(), number) - first_number_.begin() -
      1);
}

LooseReference& Half::in_block(std::uint32_t block, std::uint32_t i) const {
  LooseReference* const first = references_ + std::size_t{block} * kBlock;
  return first[first[i].note];
}

void exchange_block(const Half& lower, const Half& upper, std::uint32_t block) {
  const std::uint32_t first = lower.first_number(block), last = lower.first_number(block + 1);
  if (first == last) return;
  std::uint32_t other = upper.block_of(first);
  for (std::uint32_t number = first; number < last; ++number) {
    while (number >= upper.first_number(other + 1)) ++other;
    LooseReference& a = lower.in_block(block, number - first);
    LooseReference& b = upper.in_block(other, number - upper.first_number(other));
    swap_all_but_notes(a, b);
  }
}

void exchange(const Half& lower, const Half& upper) {
  const auto run = [&](std::uint32_t block) { exchange_block(lower, upper, block); };
  if (lower.blocks() * kBlock <= kParallel) {
    for (std::uint32_t block = 0; block < lower.blocks(); ++block) run(block);
  } else {
    tbb::parallel_for(0u, lower.blocks(), run);
  }
}

}  // namespace octrace::octree
