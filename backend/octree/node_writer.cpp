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
  write_triangles(leaves, place.triangle);
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
    below = std::max(below, write_all(family.index[order[i]], child + static_cast<std::uint32_t>(i),
                                      place));
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

// Triangles that lie together in space may lie anywhere in the scene: all are asked for before
// the first is used.
void NodeWriter::write_triangles(const Leaves& leaves, std::uint32_t place) const {
  for (std::uint32_t i = 0; i < leaves.count; ++i) {
    __builtin_prefetch(&input_.triangles[leaves.triangles[i]]);
    if (!input_.triangle_geometry.empty()) {
      __builtin_prefetch(&input_.triangle_geometry[leaves.triangles[i]]);
    }
  }
  for (std::uint32_t i = 0; i < leaves.count; ++i) {
    const kernels::Triangle& triangle = input_.triangles[leaves.triangles[i]];
    for (const std::uint32_t corner : {triangle.a, triangle.b, triangle.c}) {
      __builtin_prefetch(&input_.positions[corner]);
    }
  }
  for (std::uint32_t i = 0; i < leaves.count; ++i) {
    std::construct_at(triangles_ + place + i, leaf_triangle(input_, leaves.triangles[i]));
  }
}

}  // namespace octrace::octree
