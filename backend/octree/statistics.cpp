#include <algorithm>
#include <bit>
#include <cmath>

#include "backend/octree/octree.h"

namespace octrace::octree {

namespace {

struct Walk {
  const Octree& octree;
  Statistics& statistics;
  std::uint64_t children = 0;

  double half_area(const kernels::Node& node, int slot) const {
    double extent[3];
    for (int axis = 0; axis < 3; ++axis) {
      extent[axis] =
          std::ldexp(node.upper[axis][slot] - node.lower[axis][slot], node.exponent[axis]);
    }
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
  }

  // `area` is the surface of the node's own box relative to the root's.
  void visit(std::uint32_t index, std::uint32_t depth, double area, double root_area) {
    const kernels::Node& node = octree.nodes[index];
    statistics.depth = std::max(statistics.depth, depth);
    statistics.sah_cost += area;
    std::uint32_t child = node.first_child;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      const double share = root_area > 0.0 ? half_area(node, slot) / root_area : 1.0;
      if ((node.inner_mask >> slot) & 1) {
        ++children;
        visit(child++, depth + 1, share, root_area);
      } else if (node.meta[slot] != 0) {
        ++children;
        ++statistics.leaves;
        statistics.sah_cost += share * std::popcount(static_cast<unsigned>(node.meta[slot] >> 5));
      }
    }
  }
};

double root_half_area(const kernels::Node& root) {
  double extent[3];
  for (int axis = 0; axis < 3; ++axis) {
    int upper = 0;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      if (root.meta[slot] != 0) upper = std::max<int>(upper, root.upper[axis][slot]);
    }
    extent[axis] = std::ldexp(upper, root.exponent[axis]);
  }
  return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
}

}  // namespace

Statistics statistics(const Octree& octree) {
  Statistics result;
  result.nodes = octree.nodes.size();
  result.triangles = octree.triangles.size();
  result.bytes = octree.nodes.size() * sizeof(kernels::Node) +
                 octree.triangles.size() * sizeof(kernels::LeafTriangle);
  if (octree.nodes.empty()) return result;
  Walk walk{octree, result};
  walk.visit(0, 1, 1.0, root_half_area(octree.nodes[0]));
  result.children_per_node = static_cast<double>(walk.children) / static_cast<double>(result.nodes);
  result.triangles_per_leaf = result.leaves == 0 ? 0.0
                                                 : static_cast<double>(result.triangles) /
                                                       static_cast<double>(result.leaves);
  return result;
}

}  // namespace octrace::octree
