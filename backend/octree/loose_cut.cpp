// The same parts in the same order for any number of threads: they are listed by fixed blocks.
#include "backend/octree/loose_cut.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <array>

#include "backend/octree/reference_blocks.h"

namespace octrace::octree {

namespace {

// A reference that a plane cuts.
struct Cut {
  std::uint32_t index;
  LooseReference lower, upper;
};

struct Block {
  std::vector<Cut> cuts;
  std::uint32_t lower = 0;  // how many belong to the lower side, lower parts included
};

Block cut_block(const BuildInput& input, const LooseReference* references, std::uint32_t first,
                std::uint32_t count, const SpatialSplit& split) {
  const SidePlane plane(split.axis, split.plane);
  Block block;
  std::array<std::uint32_t, kBlock> across;
  for (const std::uint32_t last = first + count; first < last; first += kBlock) {
    std::uint32_t found = 0;
    const std::uint32_t end = std::min(last, first + kBlock);
    for (std::uint32_t i = first; i < end; ++i) {  // without branches
      const LooseReference& reference = references[i];
      across[found] = i;
      found += static_cast<std::uint32_t>(reference.lower[split.axis] < split.plane) &
               static_cast<std::uint32_t>(-reference.negated_upper[split.axis] > split.plane);
      block.lower += plane.lower_side(reference);
    }
    for (std::uint32_t i = 0; i < found; ++i) {
      Cut own{across[i], {}, {}};
      const LooseReference& reference = references[own.index];
      if (!cut(input, reference, split.axis, split.plane, &own.lower, &own.upper)) continue;
      block.cuts.push_back(own);
      block.lower += !plane.lower_side(reference);
    }
  }
  return block;
}

}  // namespace

SpatialSplit best_cut(const BuildInput& input, const LooseSplitter& splitter,
                      const LooseRange& range, const Bounds8& bounds, std::uint32_t room,
                      int bin_count) {
  SpatialBinning binning(bounds, bin_count);
  binning.leave_out_shortest();
  SpatialBins bins = tbb::parallel_reduce(
      tbb::blocked_range<std::uint32_t>(0, range.count, kParallel), SpatialBins(),
      [&](const auto& r, SpatialBins sum) {
        splitter.fill_space(input, range.references + r.begin(),
                            static_cast<std::uint32_t>(r.size()), binning, sum);
        return sum;
      },
      [&](SpatialBins a, const SpatialBins& b) {
        a.add(b, binning.bins);
        return a;
      });
  splitter.fill_space(input, range.parts.data(), static_cast<std::uint32_t>(range.parts.size()),
                      binning, bins);
  return best(bins, binning, room);
}

std::uint32_t cut_at(const BuildInput& input, const LooseRange& range, std::uint32_t room,
                     const SpatialSplit& split) {
  std::vector<Block> blocks(blocks_of(range.count));
  for_blocks(range.count, [&](std::uint32_t block, std::uint32_t first, std::uint32_t count) {
    blocks[block] = cut_block(input, range.references, first, count, split);
  });
  const auto beside = static_cast<std::uint32_t>(range.parts.size());
  const Block parts = cut_block(input, range.parts.data(), 0, beside, split);
  std::size_t made = parts.cuts.size();
  std::uint32_t lower = 0;
  for (const Block& block : blocks) {
    made += block.cuts.size();
    lower += block.lower;
  }
  const std::uint32_t all = range.total();
  const std::uint64_t below = std::uint64_t{lower} + parts.lower, above = all + made - below;
  if (made > room || below == 0 || above == 0 || below >= all || above >= all) {
    return kernels::kNone;
  }
  const auto apply = [&](const Block& block, LooseReference* to) {
    for (const Cut& own : block.cuts) to[own.index] = own.lower;
  };
  apply(parts, range.parts.data());
  for (const Block& block : blocks) apply(block, range.references);
  range.parts.reserve(beside + made);
  const auto append = [&](const Block& block) {
    for (const Cut& own : block.cuts) range.parts.push_back(own.upper);
  };
  append(parts);
  for (const Block& block : blocks) append(block);
  return lower;
}

}  // namespace octrace::octree
