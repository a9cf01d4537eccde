// Splits of references in place.
#pragma once

#include <cstdint>

#include "backend/octree/object_split.h"
#include "backend/octree/spatial_split.h"

namespace octrace::octree {

struct LooseSplitter {
  Bounds8 (*bounds)(const LooseReference*, std::uint32_t count);
  void (*fill)(const LooseReference*, std::uint32_t count, const Binning&, ObjectBins&);
  // Which of some references on one side of a range belong to the other: the note of the i-th
  // reference becomes the place of the i-th such one. Returns how many there are; adds to the
  // bounds of the lower and the upper side what belongs there.
  std::uint32_t (*find_misplaced)(LooseReference*, std::uint32_t count, bool on_upper_side,
                                  const SidePlane&, Bounds8 (&bounds)[2]);
  // Bins of space along the two axes that leave_out_shortest() leaves. Triangles that lie in
  // several are cut there as their boxes are.
  void (*fill_space)(const BuildInput&, const LooseReference*, std::uint32_t count,
                     const SpatialBinning&, SpatialBins&);
  void (*pack)(const LooseReference*, std::uint32_t count, Reference* to);

  LooseSplitter();  // for the instruction set of this machine
};

}  // namespace octrace::octree
