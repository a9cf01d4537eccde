// Trees over up to eight references, from below.
#if defined(OCTRACE_CLUSTERS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OCTRACE_CLUSTERS_INL
#undef OCTRACE_CLUSTERS_INL
#else
#define OCTRACE_CLUSTERS_INL
#endif

#include <algorithm>
#include <limits>

#include "backend/octree/box8-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

// Eight numbers, one a cluster.
using Row8 = Eight;

// Joins up to kRows references, the pair of the least surface first (Walter et al. 2008, "Fast
// agglomerative clustering for rendering"): for so few that is faster than splitting them from
// above, and the trees are as good. No loop depends on the count, which nothing could predict;
// nothing is stored by parts and loaded whole, which would wait for the stores.
template <int kRows>
class Clusters {
 public:
  // The clusters' pairs of nodes are those from first_pair on.
  HWY_ATTR static void build(const Reference* references, std::uint32_t count, BinaryNode* nodes,
                             std::uint32_t first_pair, BinaryNode& root) {
    Clusters clusters(references, count);
    for (std::uint32_t i = 0; i + 2 < count; ++i) clusters.join_nearest(nodes, first_pair + i);
    const std::uint32_t last = clusters.next();
    clusters.write(nodes, first_pair + count - 2, 0, last);
    clusters.merge(0, last, first_pair + count - 2);
    clusters.write(root, 0);
  }

 private:
  HWY_ATTR Clusters(const Reference* references, std::uint32_t count) {
    for (auto& corners : corners_) store(infinities(), corners);
    for (std::uint32_t i = 0; i < kRows; ++i) {
      const Reference& reference = references[std::min(i, count - 1)];
      for (int axis = 0; axis < 3; ++axis) {
        corners_[axis][i] = reference.lower[axis];
        corners_[3 + axis][i] = reference.negated_upper[axis];
      }
      child_[i] = BinaryNode::kLeaf | reference.triangle;
      references_[i] = 1;
    }
    const auto number = hn::Set(kTag, static_cast<float>(count));
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto slot = hn::Iota(kTag, static_cast<float>(part * kLanes));
      hn::Store(hn::IfThenElseZero(hn::Lt(slot, number), hn::Set(kTag, 1.0f)), kTag,
                alive_ + part * kLanes);
    }
    for (std::uint32_t i = 0; i < kRows; ++i) {
      store(i < count ? costs_of(i) : infinities(), cost_[i]);
    }
  }

  // The surface of the cluster joined with each other one; infinite where there is none.
  HWY_ATTR HWY_INLINE Row8 costs_of(std::uint32_t i) const {
    Row8 costs;
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t at = part * kLanes;
      Vector extent[3];
      for (int axis = 0; axis < 3; ++axis) {
        const auto lower =
            hn::Min(hn::Load(kTag, corners_[axis] + at), hn::Set(kTag, corners_[axis][i]));
        const auto upper =
            hn::Min(hn::Load(kTag, corners_[3 + axis] + at), hn::Set(kTag, corners_[3 + axis][i]));
        extent[axis] = hn::Sub(hn::Neg(upper), lower);
      }
      const auto area =
          hn::Add(hn::Add(hn::Mul(extent[0], extent[1]), hn::Mul(extent[1], extent[2])),
                  hn::Mul(extent[2], extent[0]));
      const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
      const auto self =
          hn::Eq(hn::Iota(kTag, static_cast<float>(at)), hn::Set(kTag, static_cast<float>(i)));
      const auto alive = hn::Gt(hn::Load(kTag, alive_ + at), hn::Zero(kTag));
      // No number is no less than infinity.
      const auto use = hn::And(hn::And(alive, hn::Lt(area, infinite)), hn::Not(self));
      costs.part[part] = hn::IfThenElse(use, area, infinite);
    }
    return costs;
  }

  HWY_ATTR HWY_INLINE void join_nearest(BinaryNode* nodes, std::uint32_t pair) {
    Row8 least = load(cost_[0]);
    for (std::uint32_t i = 1; i < kRows; ++i) least = lesser(least, load(cost_[i]));
    const Vector value = least_of(least);
    std::uint32_t a = 0, b = 0;
    if (hn::GetLane(value) < std::numeric_limits<float>::infinity()) {
      a = first_of(least, value);  // the costs are symmetric
      b = first_of(load(cost_[a]), value);
    } else {
      b = next();
    }
    write(nodes, pair, a, b);
    merge(a, b, pair);
    update(a, b);
  }
  // The first one after cluster 0, which always lives.
  std::uint32_t next() const {
    std::uint32_t i = 1;
    while (alive_[i] == 0.0f) ++i;
    return i;
  }

  void write(BinaryNode& node, std::uint32_t i) const {
    for (int axis = 0; axis < 3; ++axis) {
      node.lower[axis] = corners_[axis][i];
      node.upper[axis] = -corners_[3 + axis][i];
    }
    node.child = child_[i];
    node.plan = references_[i];
  }
  void write(BinaryNode* nodes, std::uint32_t pair, std::uint32_t a, std::uint32_t b) const {
    write(nodes[2 * pair], a);
    write(nodes[2 * pair + 1], b);
  }

  // b, which is after a, becomes part of a.
  HWY_ATTR HWY_INLINE void merge(std::uint32_t a, std::uint32_t b, std::uint32_t pair) {
    child_[a] = pair;
    references_[a] += references_[b];
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t at = part * kLanes;
      const auto slot = hn::Iota(kTag, static_cast<float>(at));
      const auto is_a = hn::Eq(slot, hn::Set(kTag, static_cast<float>(a)));
      const auto is_b = hn::Eq(slot, hn::Set(kTag, static_cast<float>(b)));
      for (auto& corners : corners_) {
        const auto row = hn::Load(kTag, corners + at);
        const auto joined = hn::Min(row, hn::Set(kTag, corners[b]));
        hn::Store(hn::IfThenElse(is_a, joined, row), kTag, corners + at);
      }
      const auto alive = hn::Load(kTag, alive_ + at);
      hn::Store(hn::IfThenZeroElse(is_b, alive), kTag, alive_ + at);
    }
  }

  HWY_ATTR HWY_INLINE void update(std::uint32_t a, std::uint32_t b) {
    store(costs_of(a), cost_[a]);
    store(infinities(), cost_[b]);
    const auto infinite = hn::Set(kTag, std::numeric_limits<float>::infinity());
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto slot = hn::Iota(kTag, static_cast<float>(part * kLanes));
      const auto is_a = hn::Eq(slot, hn::Set(kTag, static_cast<float>(a)));
      const auto is_b = hn::Eq(slot, hn::Set(kTag, static_cast<float>(b)));
      for (std::uint32_t i = 0; i < kRows; ++i) {
        float* at = cost_[i] + part * kLanes;
        const auto with_a = hn::IfThenElse(is_a, hn::Set(kTag, cost_[a][i]), hn::Load(kTag, at));
        hn::Store(hn::IfThenElse(is_b, infinite, with_a), kTag, at);
      }
    }
  }

  alignas(32) float corners_[6][8];  // lower, negated upper
  alignas(32) float cost_[kRows][8];
  alignas(32) float alive_[8];
  std::uint32_t child_[kRows];
  std::uint32_t references_[kRows];
};

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // once for each instruction set
