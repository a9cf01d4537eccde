#include "backend/octree/spatial_split.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace octrace::octree {

namespace {

using kernels::Vec3;

// A triangle that is cut, with what all its cuts share.
struct Cutter {
  Vec3 corners[3];
  float padding;
  float margin;

  Cutter(const Vec3& first, const Vec3& second, const Vec3& third) : corners{first, second, third} {
    float side = 0.0f, largest = 0.0f;
    for (int a = 0; a < 3; ++a) {
      const float lower = std::min({corners[0][a], corners[1][a], corners[2][a]});
      const float upper = std::max({corners[0][a], corners[1][a], corners[2][a]});
      side = std::max(side, upper - lower);
      largest = std::max({largest, -lower, upper});
    }
    padding = side * 0x1p-10f + largest * 0x1p-21f;
    margin = side * 0x1p-18f;
  }

  bool cut(const Reference& reference, int axis, float plane, Reference* lower,
           Reference* upper) const {
    if (!(plane - reference.lower[axis] > 2.0f * padding) ||
        !(reference.upper(axis) - plane > 2.0f * padding)) {
      return false;
    }
    Box below, above;
    for (int i = 0; i < 3; ++i) {
      const Vec3 &a = corners[i], &b = corners[i == 2 ? 0 : i + 1];
      if (a[axis] <= plane) below.add(float4(a));
      if (a[axis] >= plane) above.add(float4(a));
      if ((a[axis] < plane && b[axis] > plane) || (a[axis] > plane && b[axis] < plane)) {
        Vec3 crossing = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
        crossing[axis] = plane;
        below.add(float4(crossing));
        above.add(float4(crossing));
      }
    }
    const float beyond = reference.part != 0 ? 0.0f : margin;
    Reference low = reference, high = reference;
    low.part = high.part = 1;
    return bound(below, beyond, &low) && bound(above, beyond, &high) &&
           (*lower = low, *upper = high, true);
  }

 private:
  bool bound(const Box& box, float beyond, Reference* part) const {
    bool empty = false;
    for (int a = 0; a < 3; ++a) {
      part->lower[a] = std::max(part->lower[a] - beyond, box.lower[a] - padding);
      part->negated_upper[a] = std::max(part->negated_upper[a] - beyond, -(box.upper[a] + padding));
      empty |= !(part->lower[a] <= part->upper(a));
    }
    return !empty;
  }
};

void join_box(Bounds8& bounds, const Reference& reference) {
  for (int i = 0; i < 8; ++i) {
    bounds.box[i] = std::min(bounds.box[i], (&reference.lower[0])[i]);
  }
}

bool may_cut(const BuildInput& input, const Reference& reference) {
  return input.triangle_geometry.empty() ||
         may_cut(input, input.triangle_geometry[reference.triangle]);
}
bool may_cut(const BuildInput& input, const LooseReference& reference) {
  return may_cut(input, reference.corners.geometry);
}

Cutter cutter_of(const BuildInput& input, const Reference& reference) {
  const kernels::Triangle& t = input.triangles[reference.triangle];
  return {input.positions[t.a], input.positions[t.b], input.positions[t.c]};
}
Cutter cutter_of(const BuildInput& input, const LooseReference& reference) {
  const Corners& own = reference.corners;
  return {input.positions[own.a], input.positions[own.b], input.positions[own.c]};
}

// Parts are told from triangles by their boxes.
Reference box_of(const LooseReference& from, const Cutter& cutter) {
  Reference box{{from.lower[0], from.lower[1], from.lower[2]},
                from.triangle,
                {from.negated_upper[0], from.negated_upper[1], from.negated_upper[2]},
                0};
  Box whole;
  for (const Vec3& corner : cutter.corners) whole.add(float4(corner));
  for (int axis = 0; axis < 3; ++axis) {
    if (box.lower[axis] != whole.lower[axis] || box.upper(axis) != whole.upper[axis]) box.part = 1;
  }
  return box;
}

void set_box(LooseReference& reference, const Reference& box) {
  std::copy_n(box.lower, 3, reference.lower);
  std::copy_n(box.negated_upper, 3, reference.negated_upper);
}

}  // namespace

bool cut(const BuildInput& input, const Reference& reference, int axis, float plane,
         Reference* lower, Reference* upper) {
  return may_cut(input, reference) &&
         cutter_of(input, reference).cut(reference, axis, plane, lower, upper);
}

bool cut(const BuildInput& input, const LooseReference& reference, int axis, float plane,
         LooseReference* lower, LooseReference* upper) {
  if (!may_cut(input, reference)) return false;
  const Cutter cutter = cutter_of(input, reference);
  Reference below, above;
  if (!cutter.cut(box_of(reference, cutter), axis, plane, &below, &above)) return false;
  *lower = *upper = reference;
  set_box(*lower, below);
  set_box(*upper, above);
  return true;
}

SpatialBinning::SpatialBinning(const Bounds8& bounds, int bin_count) : bins(bin_count) {
  for (int axis = 0; axis < 3; ++axis) {
    lower[axis] = bounds.lower(axis);
    extent[axis] = bounds.upper(axis) - lower[axis];
    scale[axis] = static_cast<float>(bins) / extent[axis];
    // A denormal extent overflows the quotient; no plane divides such an axis.
    if (!(scale[axis] < std::numeric_limits<float>::max())) extent[axis] = scale[axis] = 0.0f;
  }
  lower[3] = scale[3] = 0.0f;
}

int SpatialBinning::shortest() const {
  int found = 0;
  for (int axis = 1; axis < 3; ++axis) {
    if (extent[axis] <= extent[found]) found = axis;
  }
  return found;
}

void SpatialBinning::leave_out_shortest() {
  const int axis = shortest();
  extent[axis] = scale[axis] = 0.0f;
}

float SpatialBinning::plane(int axis, int bin) const {
  return lower[axis] + extent[axis] * (static_cast<float>(bin) / static_cast<float>(bins));
}

void SpatialBins::add(const SpatialBins& other, int bins) {
  for (int axis = 0; axis < 3; ++axis) {
    for (int bin = 0; bin < bins; ++bin) {
      for (int i = 0; i < 8; ++i) {
        parts[axis][bin].box[i] = std::min(parts[axis][bin].box[i], other.parts[axis][bin].box[i]);
      }
      enter[axis][bin] += other.enter[axis][bin];
      leave[axis][bin] += other.leave[axis][bin];
    }
  }
}

// Axis by axis within a reference: its triangle is looked up once.
void fill(const BuildInput& input, const Reference* references, std::uint32_t count,
          const SpatialBinning& binning, SpatialBins& bins) {
  for (std::uint32_t i = 0; i < count; ++i) {
    const Reference& whole = references[i];
    std::optional<Cutter> cutter;
    bool whole_only = false;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(binning.extent[axis] > 0.0f)) continue;
      int first = binning.bin(whole.lower[axis], axis);
      int last = binning.bin(whole.upper(axis), axis);
      if (first != last && !whole_only && !cutter) {
        whole_only = !may_cut(input, whole);
        if (!whole_only) cutter.emplace(cutter_of(input, whole));
      }
      if (whole_only) first = last = binning.bin(0.5f * whole.centre2(axis), axis);
      int at = first;
      if (first == last) {
        join_box(bins.parts[axis][at], whole);
      } else {
        Reference rest = whole;
        for (int next = first; next < last; ++next) {
          Reference part;
          if (!cutter->cut(rest, axis, binning.plane(axis, next + 1), &part, &rest)) continue;
          join_box(bins.parts[axis][next], part);
          at = next + 1;
        }
        join_box(bins.parts[axis][at], rest);
      }
      ++bins.enter[axis][first];
      ++bins.leave[axis][at];
    }
  }
}

SpatialSplit best(const SpatialBins& bins, const SpatialBinning& binning, std::uint32_t most_cuts) {
  SpatialSplit split;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(binning.extent[axis] > 0.0f)) continue;
    float upper_cost[kMaxBins];
    std::uint32_t inside[kMaxBins] = {};  // references in both the bin below and this one
    for (int bin = 1; bin < binning.bins; ++bin) {
      inside[bin] = inside[bin - 1] + bins.enter[axis][bin - 1] - bins.leave[axis][bin - 1];
    }
    Bounds8 box;
    std::uint32_t references = 0;
    const auto join = [&box](const Bounds8& part) {
      for (int i = 0; i < 8; ++i) box.box[i] = std::min(box.box[i], part.box[i]);
    };
    for (int bin = binning.bins - 1; bin > 0; --bin) {
      join(bins.parts[axis][bin]);
      references += bins.leave[axis][bin];
      upper_cost[bin] = references == 0 ? -1.0f : box.half_area() * static_cast<float>(references);
    }
    box = Bounds8();
    references = 0;
    for (int bin = 1; bin < binning.bins; ++bin) {
      join(bins.parts[axis][bin - 1]);
      references += bins.enter[axis][bin - 1];
      if (references == 0 || upper_cost[bin] < 0.0f || inside[bin] > most_cuts) continue;
      const float cost = box.half_area() * static_cast<float>(references) + upper_cost[bin];
      if (cost < split.cost) split = {cost, axis, binning.plane(axis, bin)};
    }
  }
  return split;
}

}  // namespace octrace::octree
