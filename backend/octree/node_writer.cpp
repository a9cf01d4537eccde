#include "backend/octree/node_writer.h"

#include <algorithm>
#include <memory>
#include <span>

#include "backend/octree/leaf_triangle.h"
#include "backend/octree/plan.h"
#include "backend/octree/tree.h"

namespace octrace::octree {

using kernels::kChildren;

Family::Family(const BinaryNode* nodes, std::uint32_t root) {
  if (nodes[root].leaf()) {
    index[count++] = root;
  } else {
    share_out(nodes, root, kChildren, true);
  }
}

void Family::share_out(const BinaryNode* nodes, std::uint32_t root, int slots, bool divided) {
  const BinaryNode& node = nodes[root];
  const int first = slots == 1 || node.leaf() ? 0 : first_slots(node.plan, slots);
  if (!divided && first == 0) {
    index[count++] = root;
    return;
  }
  ask_for_children(nodes, nodes[2 * node.child]);
  ask_for_children(nodes, nodes[2 * node.child + 1]);
  share_out(nodes, 2 * node.child, first, false);
  share_out(nodes, 2 * node.child + 1, slots - first, false);
}

int NodeWriter::write(const Family& family, std::uint32_t index, Place& place,
                      std::array<std::uint8_t, kChildren>& order) const {
  std::array<Child, kChildren> children;
  Box bounds;
  for (int i = 0; i < family.count; ++i) {
    const BinaryNode& node = nodes_[family.index[i]];
    Box& box = children[i].box;
    box.lower = Float4{node.lower[0], node.lower[1], node.lower[2], 0.0f};
    box.upper = Float4{node.upper[0], node.upper[1], node.upper[2], 0.0f};
    bounds.add(box);
  }
  const std::span<const Child> used(children.data(), static_cast<std::size_t>(family.count));
  const Slots slots = slots_by_octant(used, bounds);
  kernels::Node& node = to_[index];
  node = {};
  quantise(used, slots, node);
  std::array<int, kChildren> at;  // by slot
  at.fill(-1);
  for (int i = 0; i < family.count; ++i) at[slots[i]] = i;
  node.first_child = place.node;
  node.first_triangle = place.triangle;
  int inner = 0;
  Leaves leaves;
  for (unsigned slot = 0; slot < kChildren; ++slot) {
    const int i = at[slot];
    if (i < 0) continue;
    if (is_leaf(nodes_[family.index[i]])) {
      const std::uint32_t offset = leaves.count;
      gather(family.index[i], leaves);
      const std::uint32_t count = leaves.count - offset;
      node.meta[slot] = static_cast<std::uint8_t>(((1u << count) - 1u) << 5 | offset);
    } else {
      node.inner_mask |= static_cast<std::uint8_t>(1u << slot);
      node.meta[slot] = static_cast<std::uint8_t>(0x20u | (24u + slot));
      order[inner++] = static_cast<std::uint8_t>(i);
    }
  }
  if (local_ != nullptr) {
    write_local(leaves, place.triangle);
  } else if (names_ != nullptr) {
    std::copy_n(leaves.triangles.begin(), leaves.count, names_ + place.triangle);
  } else {
    write_triangles(input_, leaves.triangles.data(), leaves.count, triangles_ + place.triangle);
  }
  place.triangle += leaves.count;
  place.node += static_cast<std::uint32_t>(inner);
  return inner;
}

int NodeWriter::write_all(std::uint32_t root, std::uint32_t index, Place& place) const {
  const Family family(nodes_, root);
  std::array<std::uint8_t, kChildren> order;
  const int inner = write(family, index, place, order);
  const std::uint32_t child = to_[index].first_child;
  int below = 0;
  for (int i = 0; i < inner; ++i) {
    below = std::max(
        below, write_all(family.index[order[i]], child + static_cast<std::uint32_t>(i), place));
  }
  return 1 + below;
}

void NodeWriter::gather(std::uint32_t index, Leaves& leaves) const {
  const BinaryNode& node = nodes_[index];
  if (node.leaf()) {
    leaves.triangles[leaves.count++] = node.triangle();
    return;
  }
  gather(2 * node.child, leaves);
  gather(2 * node.child + 1, leaves);
}

// Corners that lie together in space may lie anywhere in the scene: all are asked for before the
// first is used.
void NodeWriter::write_local(const Leaves& leaves, std::uint32_t place) const {
  for (std::uint32_t i = 0; i < leaves.count; ++i) {
    const Corners& corners = local_[leaves.triangles[i]].corners;
    for (const std::uint32_t corner : {corners.a, corners.b, corners.c}) {
      __builtin_prefetch(&input_.positions[corner]);
    }
  }
  for (std::uint32_t i = 0; i < leaves.count; ++i) {
    const LocalTriangle& local = local_[leaves.triangles[i]];
    const Corners& corners = local.corners;
    const std::uint32_t flags = input_.flags.empty() ? 0 : input_.flags[corners.geometry];
    std::construct_at(triangles_ + place + i,
                      kernels::LeafTriangle{input_.positions[corners.a], local.triangle,
                                            input_.positions[corners.b], flags,
                                            input_.positions[corners.c], corners.geometry});
  }
}

// Triangles that lie together in space may lie anywhere in the scene: those to come are asked for
// early, their corners when they are there.
void write_triangles(const BuildInput& input, const std::uint32_t* names, std::uint32_t count,
                     kernels::LeafTriangle* to) {
  constexpr std::uint32_t kAhead = 8;
  const auto ask = [&](std::uint32_t i) {
    if (i >= count) return;
    __builtin_prefetch(&input.triangles[names[i]]);
    if (!input.triangle_geometry.empty()) __builtin_prefetch(&input.triangle_geometry[names[i]]);
  };
  const auto ask_for_corners = [&](std::uint32_t i) {
    if (i >= count) return;
    const kernels::Triangle& triangle = input.triangles[names[i]];
    for (const std::uint32_t corner : {triangle.a, triangle.b, triangle.c}) {
      __builtin_prefetch(&input.positions[corner]);
    }
  };
  for (std::uint32_t i = 0; i < 2 * kAhead; ++i) ask(i);
  for (std::uint32_t i = 0; i < kAhead; ++i) ask_for_corners(i);
  for (std::uint32_t i = 0; i < count; ++i) {
    ask(i + 2 * kAhead);
    ask_for_corners(i + kAhead);
    std::construct_at(to + i, leaf_triangle(input, names[i]));
  }
}

void copy_subtree(const kernels::Node* from, std::uint32_t size, kernels::Node* nodes,
                  kernels::Node& root, const NodeWriter::Place& place) {
  const auto move = [&](const kernels::Node& node, kernels::Node& to) {
    to = node;
    to.first_child += place.node - 1;
    to.first_triangle += place.triangle;
  };
  move(from[0], root);
  for (std::uint32_t i = 1; i < size; ++i) move(from[i], nodes[place.node + i - 1]);
}

}  // namespace octrace::octree
