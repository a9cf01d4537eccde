// Which nodes of a binary tree become eight-way nodes, leaves or nothing, by dynamic programming,
// so that the expected cost of a ray by the surface-area heuristic is least (Ylitie, Karras, Laine
// 2017, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", section 3).
#pragma once

#include "backend/octree/binary_tree.h"

namespace octrace::octree {

// A plan, kept in the binary node. Bit 0: in one slot, the subtree is a leaf. Bits 3j - 5 to
// 3j - 3, for j = 2 to 8: of j slots, how many the first child gets; 0: the subtree takes but one
// of them. Bits 27 to 31: the logarithm of the references below.
inline constexpr std::uint32_t kLeafPlan = 1;
inline int first_slots(std::uint32_t plan, int slots) {
  return static_cast<int>((plan >> (3 * slots - 5)) & 7u);
}
inline std::uint32_t about_count(std::uint32_t plan) { return 1u << (plan >> 27); }

// In one slot, the subtree of a planned node is a leaf.
inline bool is_leaf(const BinaryNode& node) { return (node.plan & kLeafPlan) != 0; }

// Re-insertion may deepen the tree; no tree of use comes near this.
inline constexpr int kMostBinaryLevels = 1000;

// Overwrites the plans of the tree whose root is nodes[kRoot]. False: it is too deep to be of use.
bool plan(BinaryNode* nodes, std::uint32_t leaf_triangles);
// The same for a small tree of so many levels at most, which one thread takes. Finds its cost in
// one slot.
bool plan_subtree(BinaryNode* nodes, std::uint32_t leaf_triangles, int most_levels, float& cost);
// The same where leaf i stands for a subtree that takes one slot at cost costs[i].
bool plan_top(BinaryNode* nodes, const float* costs);
// The same where leaves stand for subtrees that are not built yet: what they cost more or less in
// any number of slots is guessed from their surface. Only for trees that are not too deep.
void guess_top(BinaryNode* nodes);

}  // namespace octrace::octree
