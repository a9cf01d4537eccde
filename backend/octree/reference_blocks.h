// Runs of references that threads take, and what is known of each of them.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>

#include "backend/octree/binary_tree.h"

namespace octrace::octree {

inline constexpr std::uint32_t kBlock = 4096;
inline constexpr std::uint32_t kParallel = 2 * kBlock;  // references worth a task

inline std::uint32_t blocks_of(std::uint32_t count) { return (count + kBlock - 1) / kBlock; }

// Calls body(block, first, count) for runs of references, at the same time where there are many.
template <class Body>
void for_blocks(std::uint32_t count, const Body& body) {
  const std::uint32_t blocks = blocks_of(count);
  const auto run = [&](std::uint32_t block) {
    body(block, block * kBlock, std::min(kBlock, count - block * kBlock));
  };
  if (count <= kParallel) {
    for (std::uint32_t block = 0; block < blocks; ++block) run(block);
  } else {
    tbb::parallel_for(0u, blocks, run);
  }
}

inline Bounds8 joined(Bounds8 a, const Bounds8& b) {
  for (int i = 0; i < 8; ++i) {
    a.box[i] = std::min(a.box[i], b.box[i]);
    a.centres[i] = std::min(a.centres[i], b.centres[i]);
  }
  return a;
}

}  // namespace octrace::octree
