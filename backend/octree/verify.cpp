#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "backend/octree/builders.h"
#include "backend/octree/octree.h"

namespace octrace::octree {

namespace {

using util::Error;
using util::Exit;

template <class... Args>
Error broken(fmt::format_string<Args...> text, Args&&... args) {
  return {Exit::internal, "OCTREE_BROKEN", fmt::format(text, std::forward<Args>(args)...), "", ""};
}

class Verifier {
 public:
  Verifier(const Octree& octree, const BuildInput& input)
      : octree_(octree),
        input_(input),
        seen_(input.triangles.size(), false),
        reached_(octree.nodes.size(), false) {}

  util::Result<void> run() {
    if (octree_.nodes.empty()) {
      if (!input_.triangles.empty())
        return broken("no nodes over {} triangles", input_.triangles.size());
      return {};
    }
    if (octree_.triangles.size() != input_.triangles.size()) {
      return broken("{} leaf triangles, the scene has {}", octree_.triangles.size(),
                    input_.triangles.size());
    }
    Box box;
    if (util::Result<void> ok = visit(0, 1, box); !ok) return ok;
    const auto missing = std::find(seen_.begin(), seen_.end(), false);
    if (missing != seen_.end()) return broken("triangle {} is in no leaf", missing - seen_.begin());
    const auto lost = std::find(reached_.begin(), reached_.end(), false);
    if (lost != reached_.end()) return broken("node {} cannot be reached", lost - reached_.begin());
    return {};
  }

 private:
  // Checks the subtree and returns its true box. Recursion is bounded by kMaxDepth.
  util::Result<void> visit(std::uint64_t index, int depth, Box& bounds) {
    if (depth > kernels::kMaxDepth)
      return broken("node {} lies deeper than {}", index, kernels::kMaxDepth);
    if (index >= octree_.nodes.size()) return broken("node {} does not exist", index);
    if (reached_[index]) return broken("node {} is reached twice", index);
    reached_[index] = true;
    const kernels::Node& node = octree_.nodes[index];
    std::uint64_t child = node.first_child;
    unsigned offset = 0;
    int used = 0;
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      Box box;
      if ((node.inner_mask >> slot) & 1) {
        if (node.meta[slot] != (0x20 | (24 + slot)))
          return broken("node {} slot {}: meta", index, slot);
        if (util::Result<void> ok = visit(child++, depth + 1, box); !ok) return ok;
      } else if (node.meta[slot] != 0) {
        const unsigned count = std::bit_width(static_cast<unsigned>(node.meta[slot] >> 5));
        const bool unary = (node.meta[slot] >> 5) == (1u << count) - 1u;
        if (!unary || count == 0 || (node.meta[slot] & 31u) != offset) {
          return broken("node {} slot {}: leaf counts", index, slot);
        }
        for (unsigned i = 0; i < count; ++i) {
          if (util::Result<void> ok =
                  visit_triangle(node.first_triangle + std::uint64_t{offset} + i, box);
              !ok)
            return ok;
        }
        offset += count;
      } else {
        continue;
      }
      ++used;
      if (util::Result<void> ok = check_box(index, slot, box); !ok) return ok;
      bounds.add(box);
    }
    if (used == 0) return broken("node {} has no children", index);
    return {};
  }

  util::Result<void> visit_triangle(std::uint64_t place, Box& box) {
    if (place >= octree_.triangles.size()) return broken("leaf triangle {} does not exist", place);
    const kernels::LeafTriangle& leaf = octree_.triangles[place];
    if (leaf.triangle >= input_.triangles.size())
      return broken("leaf triangle {} names triangle {}", place, leaf.triangle);
    if (seen_[leaf.triangle]) return broken("triangle {} is in two leaves", leaf.triangle);
    seen_[leaf.triangle] = true;
    const kernels::Triangle& t = input_.triangles[leaf.triangle];
    if (leaf.a != input_.positions[t.a] || leaf.b != input_.positions[t.b] ||
        leaf.c != input_.positions[t.c]) {
      return broken("leaf triangle {} has other corners than triangle {}", place, leaf.triangle);
    }
    box.add(triangle_box(input_, leaf.triangle));
    return {};
  }

  // The quantised box holds the true one, and is no looser than one step an end.
  util::Result<void> check_box(std::uint64_t index, int slot, const Box& box) const {
    const kernels::Node& node = octree_.nodes[index];
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = std::ldexp(1.0, node.exponent[axis]);
      const double lower = node.origin[axis] + node.lower[axis][slot] * scale;
      const double upper = node.origin[axis] + node.upper[axis][slot] * scale;
      if (!(lower <= box.lower[axis] && upper >= box.upper[axis])) {
        return broken("node {} slot {}: its box [{}, {}] does not hold [{}, {}] along axis {}",
                      index, slot, lower, upper, float{box.lower[axis]}, float{box.upper[axis]},
                      axis);
      }
      if (lower + scale < box.lower[axis] || upper - scale > box.upper[axis]) {
        return broken("node {} slot {}: its box [{}, {}] is loose around [{}, {}] along axis {}",
                      index, slot, lower, upper, float{box.lower[axis]}, float{box.upper[axis]},
                      axis);
      }
    }
    return {};
  }

  const Octree& octree_;
  const BuildInput& input_;
  std::vector<bool> seen_;     // by triangle
  std::vector<bool> reached_;  // by node
};

}  // namespace

util::Result<void> verify(const Octree& octree, const BuildInput& input) {
  return Verifier(octree, input).run();
}

}  // namespace octrace::octree
