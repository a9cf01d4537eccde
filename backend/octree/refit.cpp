#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "backend/octree/tree.h"
#include "backend/octree/update.h"

namespace octrace::octree {

namespace {

// Nodes of the first levels refit their children at the same time: up to 8^3 tasks.
constexpr int kParallelDepth = 3;

class Refit {
 public:
  Refit(const BuildInput& input, Octree& octree) : input_(input), octree_(octree) {}

  double run() {
    Subtree root = visit(0, 0);
    const double area = node_half_area(octree_.nodes[0]);
    // The root itself is always tested; without a surface every child is, too.
    return area > 0.0 ? 1.0 + root.cost / area : 1.0 + root.children;
  }

 private:
  struct Subtree {
    Box box;
    double cost = 0.0;      // of its children: half areas times tests
    double children = 0.0;  // tests if all are visited
  };

  static double half_area(const kernels::Node& node, const int* steps) {
    double extent[3];
    for (int axis = 0; axis < 3; ++axis)
      extent[axis] = std::ldexp(steps[axis], node.exponent[axis]);
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
  }
  static double slot_half_area(const kernels::Node& node, int slot) {
    int steps[3];
    for (int axis = 0; axis < 3; ++axis) {
      steps[axis] = node.upper[axis][slot] - node.lower[axis][slot];
    }
    return half_area(node, steps);
  }
  static double node_half_area(const kernels::Node& node) {
    int steps[3] = {};
    for (int axis = 0; axis < 3; ++axis) {
      for (int slot = 0; slot < kernels::kChildren; ++slot) {
        if (node.meta[slot] != 0) steps[axis] = std::max<int>(steps[axis], node.upper[axis][slot]);
      }
    }
    return half_area(node, steps);
  }

  Box refit_leaf(std::uint32_t first, unsigned count) {
    Box box;
    for (std::uint32_t i = first; i < first + count; ++i) {
      kernels::LeafTriangle& leaf = octree_.triangles[i];
      const kernels::Triangle& t = input_.triangles[leaf.triangle];
      leaf.a = input_.positions[t.a];
      leaf.b = input_.positions[t.b];
      leaf.c = input_.positions[t.c];
      for (const kernels::Vec3& corner : {leaf.a, leaf.b, leaf.c}) box.add(float4(corner));
    }
    return box;
  }

  // Bounded by kMaxDepth levels.
  Subtree visit(std::uint32_t index, int depth) {
    kernels::Node& node = octree_.nodes[index];
    std::array<Subtree, kernels::kChildren> below;
    const int inner = std::popcount(node.inner_mask);
    const auto descend = [&](int i) {
      below[i] = visit(node.first_child + static_cast<std::uint32_t>(i), depth + 1);
    };
    if (depth < kParallelDepth) {
      tbb::parallel_for(0, inner, descend);
    } else {
      for (int i = 0; i < inner; ++i) descend(i);
    }
    std::array<Child, kernels::kChildren> children;
    Slots slots{};
    std::size_t count = 0;
    int next = 0;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      if (node.meta[slot] == 0) continue;
      Child& child = children[count];
      slots[count++] = static_cast<std::uint8_t>(slot);
      if ((node.inner_mask >> slot) & 1) {
        child.box = below[next++].box;
      } else {
        child.leaf_count = std::bit_width(static_cast<unsigned>(node.meta[slot] >> 5));
        child.box = refit_leaf(node.first_triangle + (node.meta[slot] & 31u), child.leaf_count);
      }
    }
    const std::span<const Child> used(children.data(), count);
    quantise(used, slots, node);
    return sum(node, used, slots, below);
  }

  // In the order of slots, so that the cost does not depend on threads. The quantised boxes are
  // what rays are tested against.
  Subtree sum(const kernels::Node& node, std::span<const Child> children, const Slots& slots,
              std::span<const Subtree> below) const {
    Subtree subtree;
    for (std::size_t c = 0; c < children.size(); ++c) {
      const bool is_inner = (node.inner_mask >> slots[c]) & 1;
      const double tests = is_inner ? 1.0 : children[c].leaf_count;
      subtree.box.add(children[c].box);
      subtree.cost += tests * slot_half_area(node, slots[c]);
      subtree.children += tests;
    }
    for (int i = 0; i < std::popcount(node.inner_mask); ++i) {
      subtree.cost += below[i].cost;
      subtree.children += below[i].children;
    }
    return subtree;
  }

  const BuildInput& input_;
  Octree& octree_;
};

}  // namespace

double refit(const BuildInput& input, Octree& octree) {
  return octree.nodes.empty() ? 0.0 : Refit(input, octree).run();
}

double refit(const scene::Scene& scene, Octree& octree) {
  return refit(BuildInput{scene.positions, scene.triangles, scene.triangle_geometry, {}}, octree);
}

util::Result<void> update(const scene::Scene& scene, const BuildOptions& build_options,
                          const UpdateOptions& options, Octree& octree, Upkeep& upkeep) {
  upkeep.rebuilt = false;
  const auto follow = [&] {
    if (upkeep.built_cost == 0.0) upkeep.built_cost = statistics(octree).sah_cost;
    upkeep.cost = refit(scene, octree);
  };
  if (build_options.threads == 0) {
    follow();
  } else {
    tbb::task_arena(static_cast<int>(build_options.threads)).execute(follow);
  }
  if (upkeep.cost <= options.max_cost_growth * upkeep.built_cost) {
    return update_instance_levels(scene, build_options, octree.instances);
  }
  util::Result<Octree> built = build(scene, build_options);
  if (!built) return built.error();
  octree = std::move(*built);
  upkeep.cost = upkeep.built_cost = statistics(octree).sah_cost;
  upkeep.rebuilt = true;
  return {};
}

}  // namespace octrace::octree
