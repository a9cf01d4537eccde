// Work on an image cut into square tiles, spread over threads. What a tile computes may not depend
// on which thread does it or when, so that images are the same for any thread count and tile size.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "kernels/traverse.h"

namespace octrace::render {

struct Tile {
  std::uint32_t x0, y0, x1, y1;  // pixels x0 <= x < x1
};

struct TileFailure {
  kernels::TraceStatus status = kernels::TraceStatus::ok;
  std::uint32_t x = 0, y = 0;
};

struct TileJob {
  std::uint32_t width = 0, height = 0;
  std::uint32_t tile = 16;
  unsigned threads = 0;  // 0: all
  // False: stop, because a pixel failed.
  std::function<bool(const Tile&)> work;
  std::function<void(double)> progress;  // may be empty; one call at a time
  const std::atomic<bool>* cancel = nullptr;
};

enum class TileOutcome { done, failed, cancelled };

TileOutcome run_tiles(const TileJob& job);
unsigned effective_threads(unsigned threads);

}  // namespace octrace::render
