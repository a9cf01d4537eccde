#include "backend/octree/collapse.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <limits>
#include <memory>

#include "backend/octree/leaf_triangle.h"
#include "backend/octree/plan.h"
#include "backend/octree/tree.h"
#include "backend/util/huge_pages.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

constexpr std::uint32_t kParallel = 4096;  // references worth a task

// The children of an eight-way node, as binary nodes.
struct Family {
  std::array<std::uint32_t, kChildren> index;
  int count = 0;

  Family(const BinaryNode* nodes, std::uint32_t root) {
    if (nodes[root].leaf()) {
      index[count++] = root;
    } else {
      share_out(nodes, root, kChildren, true);
    }
  }

 private:
  void share_out(const BinaryNode* nodes, std::uint32_t root, int slots, bool divided) {
    const BinaryNode& node = nodes[root];
    const int first = slots == 1 || node.leaf() ? 0 : first_slots(node.plan, slots);
    if (!divided && first == 0) {
      index[count++] = root;
      return;
    }
    share_out(nodes, 2 * node.child, first, false);
    share_out(nodes, 2 * node.child + 1, slots - first, false);
  }
};

struct Size {
  std::uint32_t nodes = 0, triangles = 0;
  int height = 0;
};

// A large eight-way node, and what is below it: sizes must be known before threads write.
struct Plot {
  Family family;
  std::array<Size, kChildren> sizes;                   // of inner children's subtrees
  std::array<std::unique_ptr<Plot>, kChildren> plots;  // null: small
  Size size;

  explicit Plot(const Family& of) : family(of) {}
};

class Writer {
 public:
  Writer(const BinaryTree& tree, const BuildInput& input, Octree& octree)
      : nodes_(tree.nodes.get()), input_(input), octree_(octree) {}

  bool run() {
    const std::unique_ptr<Plot> root = survey(BinaryTree::kRoot, 1);
    if (root->size.height > kernels::kMaxDepth) return false;
    util::resize_in_huge_pages(octree_.nodes, root->size.nodes);
    util::resize_in_huge_pages(octree_.triangles, root->size.triangles);
    write(*root, 0, {1, 0});
    return true;
  }

 private:
  static constexpr int kTooHigh = kernels::kMaxDepth + 1;

  bool leaf(std::uint32_t index) const { return (nodes_[index].plan & kLeafPlan) != 0; }

  std::uint32_t leaf_size(std::uint32_t index) const {
    const BinaryNode& node = nodes_[index];
    return node.leaf() ? 1 : leaf_size(2 * node.child) + leaf_size(2 * node.child + 1);
  }

  Size measure(std::uint32_t index, int depth) const {
    if (depth > kernels::kMaxDepth) return {0, 0, kTooHigh};
    const Family family(nodes_, index);
    Size size{1, 0, depth};
    for (int i = 0; i < family.count; ++i) {
      if (leaf(family.index[i])) {
        size.triangles += leaf_size(family.index[i]);
      } else {
        add(measure(family.index[i], depth + 1), size);
      }
    }
    return size;
  }
  static void add(const Size& below, Size& size) {
    size.nodes += below.nodes;
    size.triangles += below.triangles;
    size.height = std::max(size.height, below.height);
  }

  std::unique_ptr<Plot> survey(std::uint32_t index, int depth) const {
    auto plot = std::make_unique<Plot>(Family(nodes_, index));
    plot->size = {1, 0, depth};
    if (depth >= kernels::kMaxDepth) {
      plot->size.height = kTooHigh;
      return plot;
    }
    tbb::parallel_for(0, plot->family.count, [&](int i) {
      const std::uint32_t child = plot->family.index[i];
      if (leaf(child)) {
        plot->sizes[i] = {0, leaf_size(child), 0};
      } else if (about_count(nodes_[child].plan) < kParallel) {
        plot->sizes[i] = measure(child, depth + 1);
      } else {
        plot->plots[i] = survey(child, depth + 1);
        plot->sizes[i] = plot->plots[i]->size;
      }
    });
    for (int i = 0; i < plot->family.count; ++i) add(plot->sizes[i], plot->size);
    return plot;
  }

  // Where the next nodes and triangles go.
  struct Place {
    std::uint32_t node, triangle;
  };

  // Depth first: a node's inner children side by side, in the order of slots, and after them what
  // is below each.
  void write(const Plot& plot, std::uint32_t index, Place place) {
    std::array<std::uint8_t, kChildren> order;
    const int inner = write_node(plot.family, index, place, order);
    std::uint32_t child = octree_.nodes[index].first_child;
    struct Job {
      int of;
      std::uint32_t index;
      Place place;
    };
    std::array<Job, kChildren> jobs;
    for (int i = 0; i < inner; ++i) {
      jobs[i] = {order[i], child++, place};
      place.node += plot.sizes[order[i]].nodes - 1;
      place.triangle += plot.sizes[order[i]].triangles;
    }
    tbb::parallel_for(0, inner, [&](int i) {
      const Job& job = jobs[i];
      if (plot.plots[job.of] != nullptr) {
        write(*plot.plots[job.of], job.index, job.place);
      } else {
        Place own = job.place;
        write_small(plot.family.index[job.of], job.index, own);
      }
    });
  }

  void write_small(std::uint32_t root, std::uint32_t index, Place& place) {
    const Family family(nodes_, root);
    std::array<std::uint8_t, kChildren> order;
    const int inner = write_node(family, index, place, order);
    const std::uint32_t child = octree_.nodes[index].first_child;
    for (int i = 0; i < inner; ++i) {
      write_small(family.index[order[i]], child + static_cast<std::uint32_t>(i), place);
    }
  }

  // Writes the node and its leaves' triangles, and leaves room for its inner children, whose places
  // in the family `order` gets. Returns how many they are.
  int write_node(const Family& family, std::uint32_t index, Place& place,
                 std::array<std::uint8_t, kChildren>& order) {
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
    kernels::Node& node = octree_.nodes[index];
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
      if (leaf(family.index[i])) {
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

  struct Leaves {
    std::array<std::uint32_t, kernels::kMaxNodeTriangles> triangles;
    std::uint32_t count = 0;
  };

  void gather(std::uint32_t index, Leaves& leaves) const {
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
  void write_triangles(const Leaves& leaves, std::uint32_t place) {
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
      octree_.triangles[place + i] = leaf_triangle(input_, leaves.triangles[i]);
    }
  }

  const BinaryNode* nodes_;
  const BuildInput& input_;
  Octree& octree_;
};

}  // namespace

bool collapse(BinaryTree& tree, std::uint32_t leaf_triangles, const BuildInput& input,
              Octree& octree) {
  return plan(tree, leaf_triangles) && Writer(tree, input, octree).run();
}

}  // namespace octrace::octree
