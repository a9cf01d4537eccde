#include "backend/render/tiles.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>

namespace octrace::render {

namespace {

Tile tile_at(const TileJob& job, std::uint64_t columns, std::uint32_t side, std::uint64_t index) {
  const std::uint64_t x0 = index % columns * side, y0 = index / columns * side;
  return {static_cast<std::uint32_t>(x0), static_cast<std::uint32_t>(y0),
          static_cast<std::uint32_t>(std::min<std::uint64_t>(x0 + side, job.width)),
          static_cast<std::uint32_t>(std::min<std::uint64_t>(y0 + side, job.height))};
}

}  // namespace

unsigned effective_threads(unsigned threads) {
  return threads != 0 ? threads : static_cast<unsigned>(tbb::info::default_concurrency());
}

tbb::task_arena& TileRunner::arena(unsigned threads) {
  if (!arena_.is_active() || arena_.max_concurrency() != static_cast<int>(threads)) {
    arena_.terminate();
    arena_.initialize(static_cast<int>(threads));
  }
  return arena_;
}

TileOutcome TileRunner::run(const TileJob& job) {
  const std::uint32_t side = std::max(job.tile, 1u);
  const std::uint64_t columns = (static_cast<std::uint64_t>(job.width) + side - 1) / side;
  const std::uint64_t rows = (static_cast<std::uint64_t>(job.height) + side - 1) / side;
  const double pixels = static_cast<double>(job.width) * job.height;
  std::atomic<bool> failed = false, cancelled = false;
  std::atomic<std::uint64_t> done = 0;
  std::mutex progress_mutex;

  const auto run_one = [&](std::uint64_t index) {
    if (failed.load(std::memory_order_relaxed) || cancelled.load(std::memory_order_relaxed)) return;
    if (job.cancel != nullptr && job.cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    const Tile tile = tile_at(job, columns, side, index);
    if (!job.work(tile)) {
      failed = true;
      return;
    }
    const std::uint64_t area = static_cast<std::uint64_t>(tile.x1 - tile.x0) * (tile.y1 - tile.y0);
    done += area;
    // A thread that finds another one reporting goes on tracing; the last tile always reports.
    if (!job.progress) return;
    const std::unique_lock lock(progress_mutex, std::try_to_lock);
    if (lock) job.progress(static_cast<double>(done.load()) / pixels);
  };

  const unsigned threads = effective_threads(job.threads);
  // Without this, an arena gets no more threads than the machine has cores.
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism,
                                  std::max<std::size_t>(threads, effective_threads(0)));
  arena(threads).execute([&] {
    tbb::parallel_for(std::uint64_t{0}, columns * rows, run_one, tbb::simple_partitioner{});
  });
  if (failed) return TileOutcome::failed;
  if (cancelled) return TileOutcome::cancelled;
  if (job.progress) job.progress(1.0);
  return TileOutcome::done;
}

}  // namespace octrace::render
