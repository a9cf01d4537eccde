// Splits of space (spatial_split.h) among references in place: of a triangle that is cut, the lower
// part takes the reference's place, and the upper one goes to a list beside the array.
#pragma once

#include <cstdint>
#include <vector>

#include "backend/octree/loose_split.h"

namespace octrace::octree {

using Parts = std::vector<LooseReference>;

// References in an array, and those beside it.
struct LooseRange {
  LooseReference* references;
  std::uint32_t count;
  Parts& parts;

  std::uint32_t total() const { return count + static_cast<std::uint32_t>(parts.size()); }
};

// The cheapest plane to cut at that makes at most about `room` parts; none where axis is -1.
SpatialSplit best_cut(const BuildInput& input, const LooseSplitter& splitter,
                      const LooseRange& range, const Bounds8& bounds, std::uint32_t room, int bins);

// Cuts what lies on both sides of the plane. Returns how many references of the array then belong
// to the lower side, by SidePlane(axis, plane). kNone, and nothing cut: more than `room` parts
// would be made, or a side would be empty or no smaller than the range.
std::uint32_t cut_at(const BuildInput& input, const LooseRange& range, std::uint32_t room,
                     const SpatialSplit& split);

}  // namespace octrace::octree
