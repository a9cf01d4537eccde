#include "backend/batch/view_objects.h"

#include <algorithm>
#include <unordered_map>

#include "backend/batch/run_length.h"

namespace octrace::batch {

namespace {

class Table {
 public:
  // The object's place in objects(); neighbouring runs often alternate between few ids.
  std::size_t slot(std::uint32_t id) {
    if (id == last_id_) return last_slot_;
    const auto [found, added] = slots_.try_emplace(id, objects_.size());
    if (added) {
      ViewObject object;
      object.id = id;
      object.left = object.top = 0xffffffffu;
      objects_.push_back(object);
    }
    last_id_ = id;
    return last_slot_ = found->second;
  }
  std::vector<ViewObject>& objects() { return objects_; }

 private:
  std::unordered_map<std::uint32_t, std::size_t> slots_;
  std::vector<ViewObject> objects_;
  std::uint32_t last_id_ = 0;
  std::size_t last_slot_ = 0;
};

void measure(std::span<const std::uint32_t> ids, std::uint32_t width, std::uint32_t height,
             Table& table) {
  for (std::uint32_t y = 0; y < height; ++y) {
    const std::uint32_t* row = ids.data() + static_cast<std::size_t>(y) * width;
    for (std::uint32_t x = 0; x < width;) {
      const std::uint32_t id = row[x], begin = x;
      while (x < width && row[x] == id) ++x;
      if (id == 0) continue;
      ViewObject& object = table.objects()[table.slot(id)];
      object.pixels += x - begin;
      object.left = std::min(object.left, begin);
      object.right = std::max(object.right, x - 1);
      object.top = std::min(object.top, y);
      object.bottom = y;
    }
  }
}

// Columns become rows, in squares that stay in the cache.
std::vector<std::uint32_t> transposed(std::span<const std::uint32_t> ids, std::uint32_t width,
                                      std::uint32_t height) {
  constexpr std::uint32_t kSide = 16;
  std::vector<std::uint32_t> out(ids.size());
  for (std::uint32_t y0 = 0; y0 < height; y0 += kSide) {
    const std::uint32_t y1 = std::min(height, y0 + kSide);
    for (std::uint32_t x0 = 0; x0 < width; x0 += kSide) {
      const std::uint32_t x1 = std::min(width, x0 + kSide);
      for (std::uint32_t x = x0; x < x1; ++x) {
        for (std::uint32_t y = y0; y < y1; ++y) {
          out[static_cast<std::size_t>(x) * height + y] =
              ids[static_cast<std::size_t>(y) * width + x];
        }
      }
    }
  }
  return out;
}

void encode(std::span<const std::uint32_t> columns, Table& table) {
  struct Runs {
    std::vector<std::uint64_t> counts;
    std::uint64_t end = 0;  // of the last run inside
  };
  std::vector<Runs> runs(table.objects().size());
  for (std::size_t i = 0; i < columns.size();) {
    const std::uint32_t id = columns[i];
    const std::size_t begin = i;
    while (i < columns.size() && columns[i] == id) ++i;
    if (id == 0) continue;
    Runs& of = runs[table.slot(id)];
    of.counts.push_back(begin - of.end);
    of.counts.push_back(i - begin);
    of.end = i;
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].end < columns.size()) runs[i].counts.push_back(columns.size() - runs[i].end);
    table.objects()[i].rle = compress_counts(runs[i].counts);
  }
}

}  // namespace

std::vector<ViewObject> find_objects(std::span<const std::uint32_t> ids, std::uint32_t width,
                                     std::uint32_t height, bool masks) {
  Table table;
  measure(ids, width, height, table);
  if (masks) encode(transposed(ids, width, height), table);
  std::vector<ViewObject> objects = std::move(table.objects());
  std::sort(objects.begin(), objects.end(),
            [](const ViewObject& a, const ViewObject& b) { return a.id < b.id; });
  return objects;
}

}  // namespace octrace::batch
