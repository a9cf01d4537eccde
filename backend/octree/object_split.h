// Splits of references by their centres, by binned surface-area heuristic (Wald 2007, "On fast
// construction of SAH-based bounding volume hierarchies"): SIMD loops chosen at run time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "backend/octree/binary_tree.h"
#include "backend/octree/box.h"

namespace octrace::octree {

inline constexpr int kMaxBins = 32;  // numbers of bins are multiples of eight

// Where a centre falls along each axis: (centre2 - lower) * scale.
struct Binning {
  float lower[4];
  float scale[4];  // 0 along axes whose centres cannot be told apart
  int bins;

  Binning(const Bounds8& bounds, int bin_count) : bins(bin_count) {
    const auto* const centres = reinterpret_cast<const Float4*>(bounds.centres);
    const Float4 low = centres[0], extent = -centres[1] - low;
    const Float4 most = Float4{} + std::numeric_limits<float>::max();
    const Float4 quotient = static_cast<float>(bins) * 0.9999f / extent;
    // A denormal extent overflows the quotient; such an axis cannot be told apart.
    const auto use = (extent > 0.0f) & (quotient < most);
    const Float4 scales = use ? quotient : Float4{};
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = low[axis];
      scale[axis] = scales[axis];
    }
    lower[3] = scale[3] = 0.0f;
  }
  int bin(float centre2, int axis) const;
};

struct alignas(32) ObjectBins {
  float boxes[3][kMaxBins][8];
  std::uint32_t counts[3][kMaxBins];

  void clear(int bins);
  void add(const ObjectBins& other, int bins);
};

struct ObjectSplit {
  float cost = std::numeric_limits<float>::infinity();  // areas times references
  int axis = -1;                                        // -1: none
  int bin = 0;                                          // the first bin of the upper side
  // Half the surface of what the two sides' boxes share, less the faces towards the sides, which
  // any two neighbours share.
  float overlap = 0.0f;
};

// Whether a reference goes to the lower side, by its centre.
struct SidePlane {
  int axis;
  float low, scale, first_upper;

  // A bin is a position without its fraction, and the first bin of the upper side is a whole
  // number, so the fractions make no difference.
  SidePlane(const Binning& binning, const ObjectSplit& split)
      : axis(split.axis),
        low(binning.lower[axis]),
        scale(binning.scale[axis]),
        first_upper(static_cast<float>(split.bin)) {}
  // A plane in space.
  SidePlane(int of_axis, float at)
      : axis(of_axis), low(0.0f), scale(1.0f), first_upper(2.0f * at) {}

  template <class R>
  float position(const R& reference) const {
    return (reference.centre2(axis) - low) * scale;
  }
  template <class R>
  bool lower_side(const R& reference) const {
    return position(reference) < first_upper;
  }
};

// What a split does to a run of references. `low` and `high` say where those of either side go, in
// their order.
struct Scatter {
  const Reference* from;
  std::uint32_t count;
  Reference* low;
  Reference* high;
  Bounds8 lower, upper;  // of what went there
};

// Nodes of a subtree that one thread builds.
struct SubtreeRange {
  Reference* references;
  Reference* spare;  // room for as many
  std::uint32_t count;
  Bounds8 bounds;
  BinaryNode* nodes;         // of the whole tree
  std::uint32_t first_pair;  // the subtree owns count - 1 pairs from here
  std::uint32_t root;        // where its root goes
  int bins;                  // of large ranges
  int sah_depth;             // levels below which ranges are halved by rank
};

struct ObjectSplitter {
  Bounds8 (*bounds)(const Reference*, std::uint32_t count);
  void (*fill)(const Reference*, std::uint32_t count, const Binning&, ObjectBins&);
  ObjectSplit (*best)(const ObjectBins&, int bins);
  // How many go to the lower side.
  std::uint32_t (*count_lower)(const Reference*, std::uint32_t count, const Binning&,
                               const ObjectSplit&);
  void (*scatter)(Scatter&, const Binning&, const ObjectSplit&);
  void (*subtree)(const SubtreeRange&);  // reorders the references

  ObjectSplitter();  // for the instruction set of this machine
};

// Halves by rank along the longest axis of the centres; the triangle decides among equals. Returns
// how many come first.
template <class R>
std::uint32_t split_by_rank(R* references, std::uint32_t count, const Bounds8& bounds) {
  float extent[3];
  for (int axis = 0; axis < 3; ++axis) {
    extent[axis] = -bounds.centres[4 + axis] - bounds.centres[axis];
  }
  int axis = extent[1] > extent[0] ? 1 : 0;
  if (extent[2] > extent[axis]) axis = 2;
  const std::uint32_t half = count / 2;
  // Parts of one triangle at the same place are alike in all that matters.
  std::nth_element(references, references + half, references + count,
                   [axis](const R& a, const R& b) {
                     const float ca = a.centre2(axis), cb = b.centre2(axis);
                     return ca < cb || (ca == cb && a.triangle < b.triangle);
                   });
  return half;
}

void write_node(BinaryNode& node, const Bounds8& bounds, std::uint32_t child, std::uint32_t count);

}  // namespace octrace::octree
