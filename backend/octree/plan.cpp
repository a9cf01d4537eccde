#include "backend/octree/plan.h"

#include <tbb/parallel_invoke.h>

#include <atomic>
#include <bit>

#include "kernels/node.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "backend/octree/plan.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "backend/octree/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace octrace::octree::HWY_NAMESPACE {

using kernels::kChildren;

// Measured: a triangle test costs about half a node test; less makes larger leaves.
constexpr float kNodeCost = 1.0f;
constexpr float kTriangleCost = 0.5f;
constexpr std::uint32_t kParallel = 4096;  // references worth a task
// Of subtrees of 512 to 4096 triangles of sponza: what they cost less in 1 to 8 slots than in one,
// as part of what they do in eight, which is their surface times kNodeCost.
constexpr float kSpared[kChildren] = {0.0f, 0.3f, 0.5f, 0.65f, 0.75f, 0.85f, 0.93f, 1.0f};

// The least cost of a subtree in at most 1 to 8 slots, in words 8 to 15; words 0 to 7 are infinite,
// so that eight costs can be read at an offset.
struct Costs {
  alignas(32) float word[16];
  std::uint32_t references;
};

// What leaves of the binary tree stand for.
enum class Leaf { triangle, subtree, guess };

class Planner {
 public:
  // `costs`: of subtrees.
  Planner(BinaryNode* nodes, Leaf kind, std::uint32_t leaf, const float* costs, int most_levels,
          bool parallel)
      : nodes_(nodes),
        kind_(kind),
        leaf_(leaf),
        costs_(costs),
        most_levels_(most_levels),
        parallel_(parallel) {}

  HWY_ATTR bool run(float& cost) {
    Costs costs;
    plan(BinaryTree::kRoot, 0, costs);
    cost = costs.word[8];
    return !too_deep_;
  }

 private:
  HWY_ATTR HWY_INLINE void plan(std::uint32_t index, int depth, Costs& costs) {
    BinaryNode& node = nodes_[index];
    store(infinities(), costs.word);
    if (node.leaf()) {
      plan_leaf(node, costs);
    } else {
      plan_inner(node, depth, costs);
    }
  }

  HWY_ATTR HWY_INLINE void plan_leaf(BinaryNode& node, Costs& costs) {
    if (kind_ == Leaf::triangle) {
      costs.references = 1;
      node.plan = kLeafPlan;
      store(eight(node.half_area() * kTriangleCost), costs.word + 8);
      return;
    }
    costs.references = leaf_ + 1;
    node.plan = 0;
    if (kind_ == Leaf::subtree) {
      store(eight(costs_[node.triangle()]), costs.word + 8);
      return;
    }
    const float most = node.half_area() * kNodeCost;
    for (int i = 0; i < kChildren; ++i) costs.word[8 + i] = -most * kSpared[i];
  }

  HWY_ATTR HWY_NOINLINE void plan_inner(BinaryNode& node, int depth, Costs& costs) {
    if (depth == most_levels_) {
      too_deep_ = true;
      store(eight(0.0f), costs.word + 8);
      costs.references = 1;
      return;
    }
    const std::uint32_t first = 2 * node.child;
    ask_for_children(nodes_, nodes_[first]);
    ask_for_children(nodes_, nodes_[first + 1]);
    Costs a, b;
    if (parallel_ && node.plan > kParallel) {  // still the builder's count
      tbb::parallel_invoke([&] { plan(first, depth + 1, a); },
                           [&] { plan(first + 1, depth + 1, b); });
    } else {
      plan(first, depth + 1, a);
      plan(first + 1, depth + 1, b);
    }
    node.plan = combine(node.half_area(), a, b, costs);
  }

  // For each number of slots the best way to share them out. The first child's costs are read at
  // offsets, since they were stored longer ago: what was just stored in parts cannot be loaded
  // across them without a wait.
  HWY_ATTR HWY_INLINE std::uint32_t combine(float area, const Costs& a, const Costs& b,
                                            Costs& costs) const {
    const hn::RebindToUnsigned<decltype(kTag)> du;
    Eight best;
    hn::Vec<decltype(du)> share[kParts];  // of the first child, for 1 to 8 slots
    for (std::size_t part = 0; part < kParts; ++part) {
      const float* firsts = a.word + 8 + part * kLanes;
      const auto number = hn::Iota(du, static_cast<std::uint32_t>(1 + part * kLanes));
      best.part[part] = hn::Set(kTag, std::numeric_limits<float>::infinity());
      share[part] = hn::Set(du, 1);
      for (int k = kChildren - 1; k > 0; --k) {  // slots of the second child
        const auto cost = hn::Add(hn::Set(kTag, b.word[7 + k]), hn::LoadU(kTag, firsts - k));
        const auto better = hn::Lt(cost, best.part[part]);
        best.part[part] = hn::IfThenElse(better, cost, best.part[part]);
        share[part] = hn::IfThenElse(hn::RebindMask(du, better),
                                     hn::Sub(number, hn::Set(du, static_cast<std::uint32_t>(k))),
                                     share[part]);
      }
    }
    costs.references = a.references + b.references;
    alignas(32) float sums[8];
    store(best, sums);
    const float inner = sums[kChildren - 1] + area * kNodeCost;
    // Where an inner node costs infinitely much as well, the count alone rules out a leaf.
    const bool few = costs.references <= leaf_;
    const float leaf = few ? area * kTriangleCost * static_cast<float>(costs.references)
                           : std::numeric_limits<float>::infinity();
    const float one = std::min(inner, leaf);
    std::uint32_t plan = few && leaf <= inner ? kLeafPlan : 0u;
    plan |= static_cast<std::uint32_t>(std::bit_width(costs.references) - 1) << 27;
    alignas(32) static constexpr std::uint32_t kFactor[8] = {
        0, 1u << 1, 1u << 4, 1u << 7, 1u << 10, 1u << 13, 1u << 16, 1u << 19};
    const auto whole = hn::Set(kTag, one);
    for (std::size_t part = 0; part < kParts; ++part) {
      // A node's own eight slots are always shared out.
      const auto divided = hn::Or(hn::Lt(best.part[part], whole),
                                  hn::Eq(slots(part), hn::Set(kTag, float{kChildren - 1})));
      const auto bits = hn::Mul(share[part], hn::Load(du, kFactor + part * kLanes));
      plan |=
          hn::GetLane(hn::SumOfLanes(du, hn::IfThenElseZero(hn::RebindMask(du, divided), bits)));
    }
    store(lesser(best, eight(one)), costs.word + 8);
    return plan;
  }

  BinaryNode* nodes_;
  const Leaf kind_;
  const std::uint32_t leaf_;
  const float* const costs_;
  const int most_levels_;
  const bool parallel_;
  std::atomic<bool> too_deep_{false};
};

HWY_ATTR bool plan_triangles(BinaryNode* nodes, std::uint32_t leaf_triangles, int most_levels,
                             bool parallel, float& cost) {
  return Planner(nodes, Leaf::triangle, leaf_triangles, nullptr, most_levels, parallel).run(cost);
}

HWY_ATTR bool plan_subtrees(BinaryNode* nodes, const float* costs) {
  float cost;
  return Planner(nodes, costs != nullptr ? Leaf::subtree : Leaf::guess, 0, costs, kMostBinaryLevels,
                 false)
      .run(cost);
}

}  // namespace octrace::octree::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::octree {

HWY_EXPORT(plan_triangles);
HWY_EXPORT(plan_subtrees);

bool plan(BinaryNode* nodes, std::uint32_t leaf_triangles) {
  float cost;
  return HWY_DYNAMIC_DISPATCH(plan_triangles)(nodes, leaf_triangles, kMostBinaryLevels, true, cost);
}

bool plan_subtree(BinaryNode* nodes, std::uint32_t leaf_triangles, int most_levels, float& cost) {
  return HWY_DYNAMIC_DISPATCH(plan_triangles)(nodes, leaf_triangles, most_levels, false, cost);
}

bool plan_top(BinaryNode* nodes, const float* costs) {
  return HWY_DYNAMIC_DISPATCH(plan_subtrees)(nodes, costs);
}

void guess_top(BinaryNode* nodes) { HWY_DYNAMIC_DISPATCH(plan_subtrees)(nodes, nullptr); }

}  // namespace octrace::octree
#endif
