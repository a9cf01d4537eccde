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
#include "backend/octree/tree.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;

// Measured: a triangle test costs about half a node test; less makes larger leaves.
constexpr float kNodeCost = 1.0f;
constexpr float kTriangleCost = 0.5f;
constexpr std::uint32_t kParallel = 4096;  // references worth a task
// Reinsertion may deepen the tree; no tree of use comes near this.
constexpr int kMaxBinaryDepth = 1000;

// A plan. Bit 0: in one slot, the subtree is a leaf. Bits 3j - 5 to 3j - 3, for j = 2 to 8: of j
// slots, how many the first child gets; 0: the subtree takes but one of them. Bits 27 to 31: the
// logarithm of the references below.
constexpr std::uint32_t kLeafPlan = 1;
constexpr std::uint32_t slots_mask(int slots) { return 7u << (3 * slots - 5); }
int first_slots(std::uint32_t plan, int slots) {
  return static_cast<int>((plan >> (3 * slots - 5)) & 7u);
}
std::uint32_t about_count(std::uint32_t plan) { return 1u << (plan >> 27); }

// The least cost of a subtree in at most 1 to 8 slots, in words 8 to 15; words 0 to 7 are infinite,
// so that a vector of costs can be read at an offset.
struct Costs {
  float word[16];
  std::uint32_t references;

  float& in(int slots) { return word[7 + slots]; }
};

class Planner {
 public:
  Planner(BinaryNode* nodes, std::uint32_t leaf) : nodes_(nodes), leaf_(leaf) {}

  bool run() {
    Costs costs;
    plan(BinaryTree::kRoot, 0, costs);
    return !too_deep_;
  }

 private:
  void plan(std::uint32_t index, int depth, Costs& costs) {
    BinaryNode& node = nodes_[index];
    const float area = node.half_area();
    std::fill_n(costs.word, 8, std::numeric_limits<float>::infinity());
    if (node.leaf()) {
      std::fill_n(costs.word + 8, 8, area * kTriangleCost);
      costs.references = 1;
      node.plan = kLeafPlan;
      return;
    }
    if (depth == kMaxBinaryDepth) {
      too_deep_ = true;
      std::fill_n(costs.word + 8, 8, 0.0f);
      costs.references = 1;
      return;
    }
    const std::uint32_t first = 2 * node.child;
    Costs a, b;
    if (node.plan > kParallel) {  // still the builder's count
      tbb::parallel_invoke([&] { plan(first, depth + 1, a); },
                           [&] { plan(first + 1, depth + 1, b); });
    } else {
      plan(first, depth + 1, a);
      plan(first + 1, depth + 1, b);
    }
    node.plan = combine(area, a, b, costs);
  }

  // For each number of slots the best way to share them out. A subtree of few references has no use
  // for more slots than those, so only shares of the smaller subtree are tried.
  std::uint32_t combine(float area, const Costs& a, const Costs& b, Costs& costs) const {
    const bool a_is_smaller = a.references < b.references;
    const Costs& small = a_is_smaller ? a : b;
    const Costs& large = a_is_smaller ? b : a;
    float best[kChildren];
    std::int32_t share[kChildren];
    for (int i = 0; i < kChildren; ++i) {
      best[i] = small.word[8] + large.word[7 + i];
      share[i] = 1;
    }
    const int most = static_cast<int>(std::min<std::uint32_t>(small.references, kChildren - 1));
    for (int k = 2; k <= most; ++k) {
      const float own = small.word[7 + k];
      for (int i = 0; i < kChildren; ++i) {
        const float cost = own + large.word[8 + i - k];
        const bool better = cost < best[i];
        best[i] = better ? cost : best[i];
        share[i] = better ? k : share[i];
      }
    }
    costs.references = a.references + b.references;
    const float inner = best[kChildren - 1] + area * kNodeCost;
    const float leaf = costs.references <= leaf_
                           ? area * kTriangleCost * static_cast<float>(costs.references)
                           : std::numeric_limits<float>::infinity();
    const float one = std::min(inner, leaf);
    std::uint32_t plan = leaf <= inner ? kLeafPlan : 0u;
    plan |= static_cast<std::uint32_t>(std::bit_width(costs.references) - 1) << 27;
    costs.in(1) = one;
    for (int slots = 2; slots <= kChildren; ++slots) {
      const float cost = best[slots - 1];
      const int first = a_is_smaller ? share[slots - 1] : slots - share[slots - 1];
      // A node's own eight slots are always shared out.
      if (cost < one || slots == kChildren) {
        plan |= static_cast<std::uint32_t>(first) << (3 * slots - 5);
      }
      costs.in(slots) = std::min(cost, one);
    }
    return plan;
  }

  BinaryNode* nodes_;
  const std::uint32_t leaf_;
  std::atomic<bool> too_deep_{false};
};

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
    octree_.nodes.resize(root->size.nodes);
    octree_.triangles.resize(root->size.triangles);
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
    for (unsigned slot = 0; slot < kChildren; ++slot) {
      const int i = at[slot];
      if (i < 0) continue;
      if (leaf(family.index[i])) {
        const std::uint32_t offset = place.triangle - node.first_triangle;
        write_leaf(family.index[i], place);
        const std::uint32_t count = place.triangle - node.first_triangle - offset;
        node.meta[slot] = static_cast<std::uint8_t>(((1u << count) - 1u) << 5 | offset);
      } else {
        node.inner_mask |= static_cast<std::uint8_t>(1u << slot);
        node.meta[slot] = static_cast<std::uint8_t>(0x20u | (24u + slot));
        order[inner++] = static_cast<std::uint8_t>(i);
      }
    }
    place.node += static_cast<std::uint32_t>(inner);
    return inner;
  }

  void write_leaf(std::uint32_t index, Place& place) {
    const BinaryNode& node = nodes_[index];
    if (node.leaf()) {
      octree_.triangles[place.triangle++] = leaf_triangle(input_, node.triangle());
      return;
    }
    write_leaf(2 * node.child, place);
    write_leaf(2 * node.child + 1, place);
  }

  const BinaryNode* nodes_;
  const BuildInput& input_;
  Octree& octree_;
};

}  // namespace

bool collapse(BinaryTree& tree, std::uint32_t leaf_triangles, const BuildInput& input,
              Octree& octree) {
  return Planner(tree.nodes.get(), leaf_triangles).run() && Writer(tree, input, octree).run();
}

}  // namespace octrace::octree
