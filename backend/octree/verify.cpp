#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>

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
        leaves_(input.triangles.size(), 0),
        reached_(octree.nodes.size(), false),
        placed_(octree.triangles.size(), false) {}

  util::Result<void> run() {
    if (octree_.nodes.empty()) {
      if (!input_.triangles.empty())
        return broken("no nodes over {} triangles", input_.triangles.size());
      return {};
    }
    for (const kernels::LeafTriangle& leaf : octree_.triangles) {
      if (leaf.triangle < leaves_.size()) ++leaves_[leaf.triangle];
    }
    const auto missing = std::find(leaves_.begin(), leaves_.end(), 0u);
    if (missing != leaves_.end()) {
      return broken("triangle {} is in no leaf", missing - leaves_.begin());
    }
    Bounds bounds;
    const double infinity = std::numeric_limits<double>::infinity();
    const Space everywhere{{-infinity, -infinity, -infinity}, {infinity, infinity, infinity}};
    if (util::Result<void> ok = visit(0, 1, everywhere, bounds); !ok) return ok;
    if (const auto place = std::find(placed_.begin(), placed_.end(), false);
        place != placed_.end()) {
      return broken("leaf triangle {} is in no leaf", place - placed_.begin());
    }
    for (const auto& [triangle, parts] : parts_) {
      if (util::Result<void> ok = check_parts(triangle, parts); !ok) return ok;
    }
    const auto lost = std::find(reached_.begin(), reached_.end(), false);
    if (lost != reached_.end()) return broken("node {} cannot be reached", lost - reached_.begin());
    return {};
  }

 private:
  struct Space {
    double lower[3], upper[3];
  };
  // Of what lies below a slot: the boxes of whole triangles, which must be held; and beside those
  // the boxes of leaves with parts of triangles, which are as large as they are.
  struct Bounds {
    Box whole, all;
    void add(const Bounds& other) {
      whole.add(other.whole);
      all.add(other.all);
    }
  };

  Space slot_space(const kernels::Node& node, int slot) const {
    Space space;
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = std::ldexp(1.0, node.exponent[axis]);
      space.lower[axis] = node.origin[axis] + node.lower[axis][slot] * scale;
      space.upper[axis] = node.origin[axis] + node.upper[axis][slot] * scale;
    }
    return space;
  }

  // Checks the subtree, which rays enter only within `space`. Recursion is bounded by kMaxDepth.
  util::Result<void> visit(std::uint64_t index, int depth, const Space& space, Bounds& bounds) {
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
      Bounds below;
      const Space own = slot_space(node, slot);
      Space common = space;
      for (int axis = 0; axis < 3; ++axis) {
        common.lower[axis] = std::max(common.lower[axis], own.lower[axis]);
        common.upper[axis] = std::min(common.upper[axis], own.upper[axis]);
      }
      if ((node.inner_mask >> slot) & 1) {
        if (node.meta[slot] != (0x20 | (24 + slot)))
          return broken("node {} slot {}: meta", index, slot);
        if (util::Result<void> ok = visit(child++, depth + 1, common, below); !ok) return ok;
      } else if (node.meta[slot] != 0) {
        const unsigned count = std::bit_width(static_cast<unsigned>(node.meta[slot] >> 5));
        const bool unary = (node.meta[slot] >> 5) == (1u << count) - 1u;
        if (!unary || count == 0 || (node.meta[slot] & 31u) != offset) {
          return broken("node {} slot {}: leaf counts", index, slot);
        }
        for (unsigned i = 0; i < count; ++i) {
          if (util::Result<void> ok = visit_triangle(
                  node.first_triangle + std::uint64_t{offset} + i, own, common, below);
              !ok)
            return ok;
        }
        offset += count;
      } else {
        continue;
      }
      ++used;
      if (util::Result<void> ok = check_box(index, slot, own, below); !ok) return ok;
      bounds.add(below);
    }
    if (used == 0) return broken("node {} has no children", index);
    return {};
  }

  util::Result<void> visit_triangle(std::uint64_t place, const Space& own, const Space& common,
                                    Bounds& bounds) {
    if (place >= octree_.triangles.size()) return broken("leaf triangle {} does not exist", place);
    if (placed_[place]) return broken("leaf triangle {} is in two leaves", place);
    placed_[place] = true;
    const kernels::LeafTriangle& leaf = octree_.triangles[place];
    if (leaf.triangle >= input_.triangles.size())
      return broken("leaf triangle {} names triangle {}", place, leaf.triangle);
    const kernels::Triangle& t = input_.triangles[leaf.triangle];
    if (leaf.a != input_.positions[t.a] || leaf.b != input_.positions[t.b] ||
        leaf.c != input_.positions[t.c]) {
      return broken("leaf triangle {} has other corners than triangle {}", place, leaf.triangle);
    }
    if (leaves_[leaf.triangle] == 1) {
      bounds.whole.add(triangle_box(input_, leaf.triangle));
      bounds.all.add(bounds.whole);
      return {};
    }
    if ((leaf.flags & kernels::kBlend) != 0) {
      return broken("BLEND triangle {} is in {} leaves, and would dim rays as often", leaf.triangle,
                    leaves_[leaf.triangle]);
    }
    parts_[leaf.triangle].push_back(common);
    bounds.all.add(own_box(own));
    return {};
  }
  static Box own_box(const Space& space) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = static_cast<float>(space.lower[axis]);
      box.upper[axis] = static_cast<float>(space.upper[axis]);
    }
    return box;
  }

  // A triangle in several leaves: every point of a fine lattice on it lies in one of them.
  util::Result<void> check_parts(std::uint32_t triangle, const std::vector<Space>& parts) const {
    constexpr int kLattice = 12;
    const kernels::Triangle& t = input_.triangles[triangle];
    for (int i = 0; i <= kLattice; ++i) {
      for (int j = 0; i + j <= kLattice; ++j) {
        double point[3];
        for (int axis = 0; axis < 3; ++axis) {
          point[axis] =
              (double{input_.positions[t.a][axis]} * (kLattice - i - j) +
               double{input_.positions[t.b][axis]} * i + double{input_.positions[t.c][axis]} * j) /
              kLattice;
        }
        const bool held = std::any_of(parts.begin(), parts.end(), [&](const Space& part) {
          bool inside = true;
          for (int axis = 0; axis < 3; ++axis) {
            inside &= part.lower[axis] <= point[axis] && point[axis] <= part.upper[axis];
          }
          return inside;
        });
        if (!held) {
          return broken("triangle {} is in {} leaves, none of which holds its point {} {} {}",
                        triangle, parts.size(), point[0], point[1], point[2]);
        }
      }
    }
    return {};
  }

  // The quantised box holds the true one, and is no looser than one step an end.
  util::Result<void> check_box(std::uint64_t index, int slot, const Space& own,
                               const Bounds& below) const {
    const kernels::Node& node = octree_.nodes[index];
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = std::ldexp(1.0, node.exponent[axis]);
      const double lower = own.lower[axis], upper = own.upper[axis];
      if (!below.whole.empty() &&
          !(lower <= below.whole.lower[axis] && upper >= below.whole.upper[axis])) {
        return broken("node {} slot {}: its box [{}, {}] does not hold [{}, {}] along axis {}",
                      index, slot, lower, upper, float{below.whole.lower[axis]},
                      float{below.whole.upper[axis]}, axis);
      }
      if (lower + scale < below.all.lower[axis] || upper - scale > below.all.upper[axis]) {
        return broken("node {} slot {}: its box [{}, {}] is loose around [{}, {}] along axis {}",
                      index, slot, lower, upper, float{below.all.lower[axis]},
                      float{below.all.upper[axis]}, axis);
      }
    }
    return {};
  }

  const Octree& octree_;
  const BuildInput& input_;
  std::vector<std::uint32_t> leaves_;                  // by triangle, in how many it is
  std::vector<bool> reached_;                          // by node
  std::vector<bool> placed_;                           // by leaf triangle
  std::map<std::uint32_t, std::vector<Space>> parts_;  // where triangles in several leaves are met
};

}  // namespace

util::Result<void> verify(const Octree& octree, const BuildInput& input) {
  return Verifier(octree, input).run();
}

}  // namespace octrace::octree
