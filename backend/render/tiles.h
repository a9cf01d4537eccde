// Work on an image cut into square tiles, spread over threads. What a tile computes may not depend
// on which thread does it or when, so that images are the same for any thread count and tile size.
#pragma once

#include <oneapi/tbb/task_arena.h>

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

// One thread at a time. All jobs share an arena, so that many views leave none behind. It is not a
// thread_local: registering its destructor would wait for the dynamic loader, which may be at work
// on the image library (image::preload).
class TileRunner {
 public:
  TileOutcome run(const TileJob& job);

 private:
  tbb::task_arena& arena(unsigned threads);

  tbb::task_arena arena_;
};

unsigned effective_threads(unsigned threads);

}  // namespace octrace::render
