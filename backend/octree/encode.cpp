// Slots and quantised boxes, eight children at once.
#include <algorithm>
#include <bit>
#include <limits>

#include "backend/octree/tree.h"
#include "kernels/quantise.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/encode.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "backend/octree/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

using kernels::kChildren;

// For each child and slot the cost is how far the child's centre lies against the slot's octant;
// pairs are taken greedily from the best (as in Ylitie et al. 2017, there with an auction). The
// first child and then the first slot wins among equals.
class SlotMatcher {
 public:
  HWY_ATTR SlotMatcher(const Child* children, std::size_t count, const Box& parent) {
    alignas(32) static constexpr float kSide[3][kChildren] = {
        {1, -1, 1, -1, 1, -1, 1, -1}, {1, 1, -1, -1, 1, 1, -1, -1}, {1, 1, 1, 1, -1, -1, -1, -1}};
    alignas(32) float offset[3][kChildren] = {};
    const Float4 centre = parent.centre2();
    for (std::size_t c = 0; c < count; ++c) {
      const Float4 own = children[c].box.centre2() - centre;
      for (int axis = 0; axis < 3; ++axis) offset[axis][c] = own[axis];
    }
    for (int i = 0; i < kChildren; ++i) {
      for (std::size_t at = 0; at < kChildren; at += kLanes) {
        hn::Store(costs(kSide, at, offset, i), kTag, by_child_[i] + at);
        hn::Store(costs(offset, at, kSide, i), kTag, by_slot_[i] + at);
      }
    }
    store(eight(0.0f), no_child_);
    store(eight(0.0f), no_slot_);
    for (std::size_t c = count; c < kChildren; ++c) take(no_child_, c);
    free_children_ = (1u << count) - 1u;
  }

  HWY_ATTR void run(Slots& slots_of) {
    while (free_children_ != 0) {
      Eight least = load(by_slot_[0]);
      for (int slot = 1; slot < kChildren; ++slot) least = lesser(least, load(by_slot_[slot]));
      least = sum(least, load(no_child_));
      const Vector value = least_of(least);
      std::size_t child = 0, slot = 0;
      if (hn::GetLane(value) < std::numeric_limits<float>::infinity()) {
        child = first_of(least, value);
        slot = first_of(sum(load(by_child_[child]), load(no_slot_)), value);
      } else {
        child = static_cast<std::size_t>(std::countr_zero(free_children_));
        slot = static_cast<std::size_t>(std::countr_zero(free_slots_));
      }
      slots_of[child] = static_cast<std::uint8_t>(slot);
      free_children_ &= ~(1u << child);
      free_slots_ &= ~(1u << slot);
      take(no_child_, child);
      take(no_slot_, slot);
      store(infinities(), by_slot_[slot]);
    }
  }

 private:
  // Of eight from `eight` on with the one of `one`. What overflows costs infinitely much.
  HWY_ATTR HWY_INLINE static Vector costs(const float (&eight)[3][kChildren], std::size_t at,
                                          const float (&one)[3][kChildren], int i) {
    Vector sum = hn::Mul(hn::Load(kTag, eight[0] + at), hn::Set(kTag, one[0][i]));
    for (int axis = 1; axis < 3; ++axis) {
      sum = hn::Add(sum, hn::Mul(hn::Load(kTag, eight[axis] + at), hn::Set(kTag, one[axis][i])));
    }
    const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
    return hn::IfThenElse(hn::Lt(hn::Abs(sum), infinite), sum, infinite);
  }
  HWY_ATTR HWY_INLINE static Eight sum(const Eight& a, const Eight& b) {
    Eight v;
    for (std::size_t i = 0; i < kParts; ++i) v.part[i] = hn::Add(a.part[i], b.part[i]);
    return v;
  }
  HWY_ATTR HWY_INLINE static void take(float* taken, std::size_t i) {
    const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto is_i = hn::Eq(slots(part), hn::Set(kTag, static_cast<float>(i)));
      float* at = taken + part * kLanes;
      hn::Store(hn::IfThenElse(is_i, infinite, hn::Load(kTag, at)), kTag, at);
    }
  }

  alignas(32) float by_child_[kChildren][kChildren], by_slot_[kChildren][kChildren];
  alignas(32) float no_child_[kChildren], no_slot_[kChildren];  // 0, or infinite where taken
  unsigned free_children_, free_slots_ = 0xffu;
};

HWY_ATTR void assign_slots(const Child* children, std::size_t count, const Box& parent,
                           Slots& slots_of) {
  SlotMatcher(children, count, parent).run(slots_of);
}

const hn::CappedTag<double, 8> kDoubles;
using Doubles = hn::Vec<decltype(kDoubles)>;
constexpr std::size_t kDoubleLanes = hn::MaxLanes(kDoubles);

// step_below() or step_above() of eight values. The steps are divisions by a power of two, so the
// difference alone is rounded, and one correction is all that can be needed.
template <bool kAbove>
HWY_ATTR HWY_INLINE void steps(const double* values, double origin, double scale,
                               std::uint8_t* steps) {
  const hn::RebindToSigned<decltype(kDoubles)> di;
  alignas(64) std::int64_t whole[kChildren];
  const auto o = hn::Set(kDoubles, origin), s = hn::Set(kDoubles, scale);
  const auto inverse = hn::Set(kDoubles, 1.0 / scale), one = hn::Set(kDoubles, 1.0);
  const auto most = hn::Set(kDoubles, 255.0);
  for (std::size_t at = 0; at < kChildren; at += kDoubleLanes) {
    const auto value = hn::Load(kDoubles, values + at);
    auto q = hn::Mul(hn::Sub(value, o), inverse);
    q = kAbove ? hn::Ceil(q) : hn::Floor(q);
    q = hn::Min(hn::Max(q, hn::Zero(kDoubles)), most);
    const auto plane = hn::Add(o, hn::Mul(q, s));
    if constexpr (kAbove) {
      q = hn::Add(q, hn::IfThenElseZero(hn::Lt(plane, value), one));
    } else {
      q = hn::Sub(q, hn::IfThenElseZero(hn::Gt(plane, value), one));
    }
    q = hn::Min(hn::Max(q, hn::Zero(kDoubles)), most);
    hn::Store(hn::ConvertTo(di, q), di, whole + at);
  }
  for (int i = 0; i < kChildren; ++i) steps[i] = static_cast<std::uint8_t>(whole[i]);
}

// As std::ldexp(1.0, exponent), which is a call, for exponents of normal numbers.
HWY_INLINE double power_of_two(int exponent) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(1023 + exponent) << 52);
}

// As kernels::exponent_for() of floats, without calls: extents of floats are normal as doubles.
HWY_INLINE std::int8_t exponent_of(double origin, double end) {
  const double extent = end - origin;
  if (!(extent > 0.0)) return kernels::kMinExponent;
  if (!(extent < std::numeric_limits<double>::infinity()))
    return kernels::exponent_for(origin, end);
  int exponent = static_cast<int>(std::bit_cast<std::uint64_t>(extent / 255.0) >> 52) - 1022;
  exponent = std::max(exponent, kernels::kMinExponent);
  if (exponent > kernels::kMinExponent && origin + 255.0 * power_of_two(exponent - 1) >= end) {
    --exponent;
  }
  return static_cast<std::int8_t>(exponent);
}

HWY_ATTR void quantise_boxes(const Child* children, std::size_t count, const Slots& slots_of,
                             kernels::Node& node) {
  Box bounds;
  for (std::size_t c = 0; c < count; ++c) bounds.add(children[c].box);
  for (int axis = 0; axis < 3; ++axis) {
    node.origin[axis] = bounds.lower[axis];
    node.exponent[axis] = exponent_of(bounds.lower[axis], bounds.upper[axis]);
    const double scale = power_of_two(node.exponent[axis]);
    alignas(64) double lower[kChildren], upper[kChildren];  // by slot; the origin where unused
    std::fill_n(lower, kChildren, double{bounds.lower[axis]});
    std::fill_n(upper, kChildren, double{bounds.lower[axis]});
    for (std::size_t c = 0; c < count; ++c) {
      lower[slots_of[c]] = children[c].box.lower[axis];
      upper[slots_of[c]] = children[c].box.upper[axis];
    }
    steps<false>(lower, bounds.lower[axis], scale, node.lower[axis]);
    steps<true>(upper, bounds.lower[axis], scale, node.upper[axis]);
  }
}

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::octree {

HWY_EXPORT(assign_slots);
HWY_EXPORT(quantise_boxes);

Slots slots_by_octant(std::span<const Child> children, const Box& parent) {
  Slots slots{};
  HWY_DYNAMIC_DISPATCH(assign_slots)(children.data(), children.size(), parent, slots);
  return slots;
}

void quantise(std::span<const Child> children, const Slots& slots, kernels::Node& node) {
  HWY_DYNAMIC_DISPATCH(quantise_boxes)(children.data(), children.size(), slots, node);
}

void encode(std::span<const Child> children, const Slots& slots, TreeNode& tree) {
  kernels::Node& node = tree.node;
  node = {};
  quantise(children, slots, node);
  for (std::size_t c = 0; c < children.size(); ++c) {
    const int slot = slots[c];
    const Child& child = children[c];
    if (child.node != nullptr) {
      tree.children[slot] = child.node;
      node.inner_mask |= static_cast<std::uint8_t>(1u << slot);
      node.meta[slot] = static_cast<std::uint8_t>(0x20u | (24u + static_cast<unsigned>(slot)));
      tree.subtree_nodes += child.node->subtree_nodes;
      tree.subtree_triangles += child.node->subtree_triangles;
      tree.height = std::max(tree.height, child.node->height + 1);
    } else {
      tree.leaf_first[slot] = child.leaf_first;
      tree.leaf_count[slot] = static_cast<std::uint8_t>(child.leaf_count);
      tree.subtree_triangles += child.leaf_count;
    }
  }
  unsigned offset = 0;
  for (int slot = 0; slot < kernels::kChildren; ++slot) {
    const unsigned count = tree.leaf_count[slot];
    if (count == 0) continue;
    node.meta[slot] = static_cast<std::uint8_t>(((1u << count) - 1u) << 5 | offset);
    offset += count;
  }
}

}  // namespace octrace::octree
#endif
