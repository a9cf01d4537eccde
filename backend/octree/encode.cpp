#include <algorithm>
#include <cmath>
#include <limits>

#include "backend/octree/tree.h"
#include "kernels/quantise.h"

namespace octrace::octree {

using kernels::exponent_for, kernels::step_above, kernels::step_below;

Slots slots_by_octant(std::span<const Child> children, const Box& parent) {
  // For each child and slot the cost is how far the child's centre lies against the slot's octant;
  // pairs are taken greedily from the best (as in Ylitie et al. 2017, there with an auction).
  const Float4 centre = parent.centre2();
  float cost[kernels::kChildren][kernels::kChildren];
  for (std::size_t c = 0; c < children.size(); ++c) {
    const Float4 offset = children[c].box.centre2() - centre;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      float sum = 0.0f;
      for (int axis = 0; axis < 3; ++axis) {
        sum += (slot >> axis) & 1 ? -offset[axis] : offset[axis];
      }
      cost[c][slot] = sum;
    }
  }
  Slots slots{};
  unsigned free_slots = 0xffu;
  unsigned free_children = (1u << children.size()) - 1u;
  while (free_children != 0) {
    float best = std::numeric_limits<float>::infinity();
    int best_child = std::countr_zero(free_children);
    int best_slot = std::countr_zero(free_slots);
    for (unsigned cs = free_children; cs != 0; cs &= cs - 1) {
      const int c = std::countr_zero(cs);
      for (unsigned ss = free_slots; ss != 0; ss &= ss - 1) {
        const int s = std::countr_zero(ss);
        if (cost[c][s] < best) {
          best = cost[c][s];
          best_child = c;
          best_slot = s;
        }
      }
    }
    slots[best_child] = static_cast<std::uint8_t>(best_slot);
    free_children &= ~(1u << best_child);
    free_slots &= ~(1u << best_slot);
  }
  return slots;
}

void quantise(std::span<const Child> children, const Slots& slots, kernels::Node& node) {
  Box bounds;
  for (const Child& child : children) bounds.add(child.box);
  for (int axis = 0; axis < 3; ++axis) {
    node.origin[axis] = bounds.lower[axis];
    node.exponent[axis] = exponent_for(bounds.lower[axis], bounds.upper[axis]);
    const double scale = std::ldexp(1.0, node.exponent[axis]);
    for (std::size_t c = 0; c < children.size(); ++c) {
      const int slot = slots[c];
      node.lower[axis][slot] = step_below(node.origin[axis], scale, children[c].box.lower[axis]);
      node.upper[axis][slot] = step_above(node.origin[axis], scale, children[c].box.upper[axis]);
    }
  }
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
