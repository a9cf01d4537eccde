// Three passes over the triangles: for the bounds of their centres; to join their boxes cell by
// cell; and, once the cells are split, to write each reference to the range that its cell has come
// to. Ranges have their references in the order of the triangles; of equal zeros the last in that
// order counts, or, in boxes of cells, whose order std::partition() leaves open, all have one sign:
// so nothing depends on how the passes are shared out.
#include "backend/octree/top_cells.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "backend/octree/loose_reference.h"
#include "backend/octree/loose_split.h"
#include "backend/octree/reference_blocks.h"

namespace octrace::octree {

namespace {

using Int4 = std::int32_t __attribute__((vector_size(16)));
using Place = std::array<std::int32_t, 3>;  // of a cell, along the axes

// Cubes, in rows along x, those in layers along y.
class Grid {
 public:
  // Over the centres, of at most so many cells.
  Grid(const Bounds8& bounds, std::uint32_t most) {
    float extent[3], longest = 0.0f;
    bool finite = true;
    for (int axis = 0; axis < 3; ++axis) {
      lower_[axis] = bounds.centres[axis];
      extent[axis] = -bounds.centres[4 + axis] - bounds.centres[axis];
      finite &= std::isfinite(extent[axis]);
      longest = std::max(longest, extent[axis]);
    }
    int least = 1, beyond = 1024;  // cells along the longest axis
    while (beyond - least > 1) {
      const int across = (least + beyond) / 2;
      set(extent, longest, across);
      (size() <= most ? least : beyond) = across;
    }
    set(extent, longest, least);
    usable_ = finite && std::isfinite(scale_) && longest > 0.0f;
  }

  bool usable() const { return usable_; }
  std::uint64_t size() const {
    return std::uint64_t(cells_[0]) * std::uint64_t(cells_[1]) * std::uint64_t(cells_[2]);
  }
  std::uint32_t cell(Float4 centre2) const {
    const Int4 at = __builtin_convertvector((centre2 - lower_) * scale_, Int4);
    const Int4 in = at < last_ ? at : last_;
    return static_cast<std::uint32_t>(in[0] + cells_[0] * (in[1] + cells_[1] * in[2]));
  }
  Place place(std::uint32_t cell) const {
    const auto at = static_cast<std::int32_t>(cell);
    return {at % cells_[0], at / cells_[0] % cells_[1], at / cells_[0] / cells_[1]};
  }

 private:
  void set(const float (&extent)[3], float longest, int across) {
    scale_ = static_cast<float>(across) * 0.9999f / longest;
    for (int axis = 0; axis < 3; ++axis) {
      const float last = extent[axis] * scale_;
      last_[axis] = last < static_cast<float>(across) ? static_cast<int>(last) : across - 1;
      cells_[axis] = last_[axis] + 1;
    }
  }

  Float4 lower_{};
  float scale_ = 0.0f;
  Int4 last_{};
  int cells_[3] = {1, 1, 1};
  bool usable_ = false;
};

// How many triangles have their centres in a cell, and the box around all of them.
class Cell {
 public:
  void clear() {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    lower_ = Float4{kInfinity, kInfinity, kInfinity, 0.0f};
    negated_upper_ = Float4{} + kInfinity;
  }
  void add(Float4 lower, Float4 negated_upper, std::int32_t count) {
    constexpr Int4 kAxes{-1, -1, -1, 0};
    const auto sum =
        reinterpret_cast<Float4>(reinterpret_cast<Int4>(lower_) + Int4{0, 0, 0, count});
    lower_ = kAxes ? lesser(lower_, lower) : sum;
    negated_upper_ = lesser(negated_upper_, negated_upper);
  }
  void add(const Cell& other) { add(other.lower_, other.negated_upper_, other.signed_count()); }

  // Word 3 of neither means anything.
  Float4 lower() const { return lower_; }
  Float4 negated_upper() const { return negated_upper_; }
  std::uint32_t count() const { return static_cast<std::uint32_t>(signed_count()); }

 private:
  std::int32_t signed_count() const { return reinterpret_cast<Int4>(lower_)[3]; }

  Float4 lower_;  // and the count as word 3, so that both are stored at once
  Float4 negated_upper_;
};

using Cells = util::HugeVector<Cell>;

// A cell that is not empty.
struct Item {
  Place at;
  std::uint32_t cell;
};

struct Leaf {
  TopRange* range;
  std::span<Item> items;
};

// A share of the triangles, which one thread takes.
struct Share {
  std::uint32_t first, last;
};

std::vector<Share> shares(std::uint32_t count, std::uint32_t number) {
  std::vector<Share> all;
  for (std::uint64_t i = 0; i < number; ++i) {
    all.push_back({static_cast<std::uint32_t>(i * count / number),
                   static_cast<std::uint32_t>((i + 1) * count / number)});
  }
  return all;
}

class CellSplitter {
 public:
  CellSplitter(const BuildInput& input, const TopOptions& options, const Grid& grid,
               const TopRange& root, std::uint32_t unit)
      : input_(input),
        options_(options),
        grid_(grid),
        unit_(unit),
        root_area_(root.bounds.half_area()),
        threads_(static_cast<std::uint32_t>(tbb::this_task_arena::max_concurrency())) {}

  void run(TopRange& root, LooseReference* references) {
    fill(root.count);
    std::vector<Item> items = occupied();
    std::vector<Leaf> leaves;
    split(root, items, leaves);
    Cells().swap(cells_);  // before the references' memory is touched
    set_first(root, 0);
    write(leaves, references);
  }

 private:
  void fill(std::uint32_t count) {
    const std::size_t size = grid_.size();
    cell_of_.resize(count);
    // Each thread fills cells of its own, in as much memory as the references will take.
    const std::uint64_t most =
        std::uint64_t{count} * sizeof(LooseReference) / (size * sizeof(Cell));
    const std::vector<Share> all =
        shares(count, static_cast<std::uint32_t>(std::clamp<std::uint64_t>(most, 1, threads_)));
    std::vector<Cells> cells(all.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
      cells[i].resize(size);
      fill(all[i], cells[i]);
    });
    cells_ = std::move(cells[0]);
    if (all.size() == 1) return;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size, kBlock), [&](const auto& range) {
      for (std::size_t i = 1; i < cells.size(); ++i) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) cells_[c].add(cells[i][c]);
      }
    });
  }
  void fill(const Share& share, Cells& cells) {
    for (Cell& cell : cells) cell.clear();
    for (std::uint32_t i = share.first; i < share.last; ++i) {
      const Box box = triangle_box(input_, i);
      const std::uint32_t cell = grid_.cell(box.centre2());
      cell_of_[i] = cell;
      // Zeros of one sign, whatever the order in which cells are joined.
      constexpr Float4 kZero{};
      cells[cell].add(kZero + box.lower, kZero - box.upper, 1);
    }
  }

  std::vector<Item> occupied() const {
    std::vector<Item> items;
    for (std::uint32_t cell = 0; cell < cells_.size(); ++cell) {
      if (cells_[cell].count() != 0) items.push_back({grid_.place(cell), cell});
    }
    return items;
  }

  // Lists the leaves in order.
  void split(TopRange& range, std::span<Item> items, std::vector<Leaf>& leaves) {
    Place least = items[0].at, greatest = least;
    for (const Item& item : items) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        least[axis] = std::min(least[axis], item.at[axis]);
        greatest[axis] = std::max(greatest[axis], item.at[axis]);
      }
    }
    int across = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      across = std::max(across, greatest[axis] - least[axis] + 1);
    }
    const std::size_t middle = across < options_.least_cells || range.count <= unit_
                                   ? 0
                                   : divide(range, items, least, across);
    if (middle == 0) {
      leaves.push_back({&range, items});
      return;
    }
    std::vector<Leaf> more;
    tbb::parallel_invoke([&] { split(*range.lower, items.first(middle), leaves); },
                         [&] { split(*range.upper, items.subspan(middle), more); });
    leaves.insert(leaves.end(), more.begin(), more.end());
  }

  // Returns how many of the items, which are sorted, are in the lower range; 0: the range stays as
  // it is.
  std::size_t divide(TopRange& range, std::span<Item> items, const Place& least, int across) {
    if (range.depth >= options_.sah_depth) return 0;
    const auto bin = [&](const Item& item, std::size_t axis) {
      const int at = item.at[axis] - least[axis];
      return across <= kMaxBins ? at : at * kMaxBins / across;
    };
    ObjectBins bins;
    bins.clear(kMaxBins);
    for (const Item& item : items) {
      const Cell& cell = cells_[item.cell];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int at = bin(item, axis);
        auto* const row = reinterpret_cast<Float4*>(bins.boxes[axis][at]);
        row[0] = lesser(row[0], cell.lower());
        row[1] = lesser(row[1], cell.negated_upper());
        bins.counts[axis][at] += cell.count();
      }
    }
    const ObjectSplit chosen = splitter_.best(bins, kMaxBins);
    if (chosen.axis < 0) return 0;
    if (range.room != 0 && chosen.overlap > options_.least_overlap * root_area_) return 0;
    const auto axis = static_cast<std::size_t>(chosen.axis);
    const auto middle = std::partition(
        items.begin(), items.end(), [&](const Item& item) { return bin(item, axis) < chosen.bin; });
    range.lower = std::make_unique<TopRange>();
    range.upper = std::make_unique<TopRange>();
    for (int i = 0; i < kMaxBins; ++i) {
      TopRange& side = i < chosen.bin ? *range.lower : *range.upper;
      side.count += bins.counts[axis][i];
      for (int word : {0, 1, 2, 4, 5, 6}) {
        side.bounds.box[word] = std::min(side.bounds.box[word], bins.boxes[axis][i][word]);
      }
    }
    hand_down(range);
    return static_cast<std::size_t>(middle - items.begin());
  }

  static void set_first(TopRange& range, std::uint32_t first) {
    range.first = first;
    if (range.lower == nullptr) return;
    set_first(*range.lower, first);
    set_first(*range.upper, first + range.lower->count);
  }

  // Where the next reference of a leaf goes, and the bounds of the centres of those that are there.
  struct Cursor {
    std::uint32_t next = 0;
    Box centres;
  };

  void write(const std::vector<Leaf>& leaves, LooseReference* references) {
    util::HugeVector<std::uint32_t> leaf_of(grid_.size());
    for (std::uint32_t leaf = 0; leaf < leaves.size(); ++leaf) {
      for (const Item& item : leaves[leaf].items) leaf_of[item.cell] = leaf;
    }
    const auto count = static_cast<std::uint32_t>(cell_of_.size());
    // At most 6 bytes a triangle of cursors.
    const auto most = static_cast<std::uint32_t>(count / (8 * leaves.size()));
    const std::vector<Share> all =
        shares(count, threads_ == 1 ? 1 : std::clamp(most, 1u, 4 * threads_));
    std::vector<std::vector<Cursor>> cursors(all.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
      cursors[i].resize(leaves.size());
      for (std::uint32_t t = all[i].first; t < all[i].last; ++t) {
        const std::uint32_t leaf = leaf_of[cell_of_[t]];
        cell_of_[t] = leaf;
        ++cursors[i][leaf].next;
      }
    });
    for_leaves(leaves, [&](std::size_t leaf) {
      std::uint32_t first = leaves[leaf].range->first;
      for (auto& of_share : cursors) first += std::exchange(of_share[leaf].next, first);
    });
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
      for (std::uint32_t t = all[i].first; t < all[i].last; ++t) {
        Cursor& cursor = cursors[i][cell_of_[t]];
        const Box box = triangle_box(input_, t);
        cursor.centres.add(box.centre2());
        std::construct_at(references + cursor.next++, loose_reference(input_, t, box));
      }
    });
    for_leaves(leaves, [&](std::size_t leaf) {
      Box centres;
      for (const auto& of_share : cursors) centres.add(of_share[leaf].centres);
      Bounds8& bounds = leaves[leaf].range->bounds;
      for (int axis = 0; axis < 3; ++axis) {
        bounds.centres[axis] = centres.lower[axis];
        bounds.centres[4 + axis] = -centres.upper[axis];
      }
    });
  }

  template <class Visit>
  static void for_leaves(const std::vector<Leaf>& leaves, const Visit& visit) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size(), 64), [&](const auto& some) {
      for (std::size_t leaf = some.begin(); leaf < some.end(); ++leaf) visit(leaf);
    });
  }

  const BuildInput& input_;
  const TopOptions& options_;
  const Grid& grid_;
  const std::uint32_t unit_;
  const float root_area_;
  const std::uint32_t threads_;
  const ObjectSplitter splitter_;
  Cells cells_;
  util::HugeVector<std::uint32_t> cell_of_;  // by triangle; then its leaf
};

// Whether the sides of a first split between some of the triangles would call for cuts.
bool seems_to_overlap(const BuildInput& input, const TopOptions& options) {
  constexpr std::size_t kMost = 8192;
  const std::size_t count = input.triangles.size(), stride = (count + kMost - 1) / kMost;
  std::vector<LooseReference> some;
  some.reserve(kMost);
  for (std::size_t i = 0; i < count; i += stride) {
    const auto triangle = static_cast<std::uint32_t>(i);
    some.push_back(loose_reference(input, triangle, triangle_box(input, triangle)));
  }
  const LooseSplitter splitter;
  const auto number = static_cast<std::uint32_t>(some.size());
  const Bounds8 bounds = splitter.bounds(some.data(), number);
  const Binning binning(bounds, options.bins);
  ObjectBins bins;
  bins.clear(options.bins);
  splitter.fill(some.data(), number, binning, bins);
  return ObjectSplitter().best(bins, options.bins).overlap >
         options.least_overlap * bounds.half_area();
}

}  // namespace

bool split_by_cells(const BuildInput& input, const TopOptions& options, std::uint32_t unit,
                    TopRange& root, LooseReference* references) {
  if (options.sah_depth == 0) return false;
  if (root.room != 0 && seems_to_overlap(input, options)) return false;
  const Bounds8 bounds = for_triangles(input, [](std::uint32_t, const Box&) {});
  const Grid grid(bounds,
                  std::clamp(root.count / options.triangles_a_cell, 1u, options.most_cells));
  if (!grid.usable()) return false;
  root.bounds = bounds;
  CellSplitter(input, options, grid, root, unit).run(root, references);
  return true;
}

}  // namespace octrace::octree
