// Splits of space, which cut triangles into parts (Stich, Friedrich, Dietrich 2009, "Spatial splits
// in bounding volume hierarchies").
//
// The box of a part is larger than the part, so that the computed hit, which may stray from its
// place (kernels/triangle.h), lies in the box of one of the parts: by 2^-10 of the triangle's
// longest side, twice the weights' error; and by 2^-21 of the largest coordinate, four times the
// rounding of the corners that clipping makes. It never passes the triangle's own box by more than
// 2^-18 of the longest side, which with the padding of box tests covers the rounding of t.
#pragma once

#include <algorithm>
#include <limits>

#include "backend/octree/binary_tree.h"
#include "backend/octree/object_split.h"

namespace octrace::octree {

// Planes at equal distances between the bounds of a range.
struct SpatialBinning {
  float lower[4];
  float extent[3];  // 0: not to be divided
  float scale[4];
  int bins;

  SpatialBinning(const Bounds8& bounds, int bin_count);
  int shortest() const;  // the axis of the least extent
  // No planes across the shortest side, which `sah` does without: in sponza no cut of a large range
  // was cheapest there (docs/performance.md).
  void leave_out_shortest();
  float plane(int axis, int bin) const;  // the lower end of the bin
  int bin(float position, int axis) const {
    return std::clamp(static_cast<int>((position - lower[axis]) * scale[axis]), 0, bins - 1);
  }
};

struct SpatialBins {
  Bounds8 parts[3][kMaxBins];
  std::uint32_t enter[3][kMaxBins] = {};  // references that begin here
  std::uint32_t leave[3][kMaxBins] = {};  // and end here

  void add(const SpatialBins& other, int bins);
};

struct SpatialSplit {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;
  float plane = 0.0f;
};

// A ray is dimmed once by a BLEND triangle, so that must be in one leaf.
inline bool may_cut(const BuildInput& input, std::uint32_t geometry) {
  return input.flags.empty() || (input.flags[geometry] & kernels::kBlend) == 0;
}

// Cuts the reference in two. False, and both untouched: it may not be cut, or one part would be no
// smaller than the reference.
bool cut(const BuildInput& input, const Reference& reference, int axis, float plane,
         Reference* lower, Reference* upper);
bool cut(const BuildInput& input, const LooseReference& reference, int axis, float plane,
         LooseReference* lower, LooseReference* upper);

// Adds references to the bins, cut at all planes.
void fill(const BuildInput& input, const Reference* references, std::uint32_t count,
          const SpatialBinning& binning, SpatialBins& bins);
// Of the planes that have at most about so many references on both sides: boxes are counted.
SpatialSplit best(const SpatialBins& bins, const SpatialBinning& binning, std::uint32_t most_cuts);

}  // namespace octrace::octree
