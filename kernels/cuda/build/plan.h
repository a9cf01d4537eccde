// Which binary nodes become eight-way nodes and leaves: the cheapest way by the surface-area
// heuristic, by dynamic programming from the leaves up (Ylitie, Karras, Laine 2017, section 3.1).
#pragma once

#include "kernels/node.h"

namespace octrace::kernels::cuda {

// Relative times of visiting a node and of testing a triangle.
inline constexpr float kNodeCost = 1.0f;
inline constexpr float kTriangleCost = 0.3f;

// Of one binary node: cost[i - 1] is what its triangles cost in a forest of at most i children,
// i = 1 to 7. choices: bits 4 * (i - 2) on, i = 2 to 8: how many of i children the left subtree
// gets, or 0 where i - 1 children are as cheap.
struct alignas(16) Plan {
  float cost[kChildren - 1];
  std::uint32_t choices;
};
static_assert(sizeof(Plan) == 32);

OCTRACE_HD inline int left_share(std::uint32_t choices, int children) {
  return static_cast<int>(choices >> 4 * (children - 2) & 15u);
}

OCTRACE_HD inline Plan plan_leaf(float half_area) {
  Plan plan{};
  for (float& cost : plan.cost) cost = half_area * kTriangleCost;
  return plan;
}

OCTRACE_HD inline Plan plan_node(const Plan& left, const Plan& right, float half_area,
                                 std::uint32_t triangles) {
  float spread[kChildren + 1];  // by children: the cheapest forest of two or more trees
  Plan plan{};
  for (int children = 2; children <= kChildren; ++children) {
    float best = left.cost[0] + right.cost[children - 2];
    std::uint32_t share = 1;
    for (int k = 2; k < children; ++k) {
      const float cost = left.cost[k - 1] + right.cost[children - k - 1];
      if (cost < best) {
        best = cost;
        share = static_cast<std::uint32_t>(k);
      }
    }
    spread[children] = best;
    plan.choices |= share << 4 * (children - 2);
  }
  const float as_node = spread[kChildren] + half_area * kNodeCost;
  const float as_leaf = half_area * kTriangleCost * static_cast<float>(triangles);
  plan.cost[0] = triangles <= kMaxLeafTriangles && as_leaf < as_node ? as_leaf : as_node;
  for (int children = 2; children < kChildren; ++children) {
    plan.cost[children - 1] = spread[children];
    if (!(plan.cost[children - 2] <= spread[children])) continue;
    plan.cost[children - 1] = plan.cost[children - 2];
    plan.choices &= ~(15u << 4 * (children - 2));
  }
  return plan;
}

}  // namespace octrace::kernels::cuda
