#include "backend/octree/wide.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "backend/octree/box.h"
#include "backend/util/huge_pages.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;
using kernels::kWideLanes;
using kernels::Node;
using kernels::WideNode;

constexpr std::uint32_t kParallelTriangles = 16384;

// A child's box as it was quantised. Exact: eight bits above the origin, or rounded to the nearest
// float, which is what the walk of the compressed nodes does.
Box quantised_box(const Node& node, int slot) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    const double scale = std::ldexp(1.0, node.exponent[axis]);
    const double lower = node.origin[axis] + node.lower[axis][slot] * scale;
    const double upper = node.origin[axis] + node.upper[axis][slot] * scale;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    auto below = static_cast<float>(lower), above = static_cast<float>(upper);
    if (below > lower) below = std::nextafter(below, -kInfinity);
    if (above < upper) above = std::nextafter(above, kInfinity);
    box.lower[axis] = below;
    box.upper[axis] = above;
  }
  box.lower[3] = box.upper[3] = 0.0f;
  return box;
}

struct Leaf {
  Box box;
  int slot = 0;
  std::uint32_t count = 0;
  std::array<std::uint32_t, kWideLanes> triangles{};  // places in the octree's array
};

// Per node of the octree, children before parents.
struct Subtree {
  std::uint32_t triangles = 0;
  std::uint32_t wide_nodes = 0;  // below and with this node; 0: it becomes a leaf
};

class Widener {
 public:
  Widener(const kernels::OctreeView& from, WideOctree& to) : from_(from), to_(to) {}

  void run() {
    if (!measure()) return;
    const std::uint32_t nodes = std::max(subtrees_[0].wide_nodes, 1u);
    util::resize_in_huge_pages(to_.nodes, nodes);
    util::resize_in_huge_pages(to_.leaves,
                               std::uint64_t{subtrees_[0].triangles} * kernels::kLeafRows +
                                   kWideLanes * kernels::kLeafRows);
    const Box box = write(0, 0, 1, 0, 0.0f);
    to_.lower = {box.lower[0], box.lower[1], box.lower[2]};
    to_.upper = {box.upper[0], box.upper[1], box.upper[2]};
  }

 private:
  // Counts, and makes sure that what follows cannot leave the arrays: every builder puts children
  // after their parents, so a walk downwards ends.
  bool measure() {
    const std::uint64_t count = from_.nodes.size;
    if (count == 0 || count > kernels::kMaxWideNodes) return false;
    subtrees_.resize(count);
    std::vector<std::uint8_t> height(count, 1);
    for (std::uint64_t i = count; i-- > 0;) {
      const Node& node = from_.nodes[i];
      Subtree& sum = subtrees_[i];
      std::uint64_t triangles = 0, nodes = 1, child = node.first_child;
      for (int slot = 0; slot < kChildren; ++slot) {
        if ((node.inner_mask >> slot) & 1) {
          if (child <= i || child >= count) return false;
          triangles += subtrees_[child].triangles;
          nodes += subtrees_[child].wide_nodes;
          height[i] = std::max<std::uint8_t>(height[i], height[child] + 1);
          ++child;
        } else if (node.meta[slot] != 0) {
          const auto in_leaf = static_cast<unsigned>(std::popcount(node.meta[slot] >> 5 & 7u));
          if (node.first_triangle + std::uint64_t{node.meta[slot] & 31u} + in_leaf >
              from_.triangles.size)
            return false;
          triangles += in_leaf;
        }
      }
      if (triangles == 0 || triangles > kernels::kMaxWideTriangles ||
          height[i] > kernels::kMaxDepth)
        return false;
      sum.triangles = static_cast<std::uint32_t>(triangles);
      sum.wide_nodes = triangles <= kWideLanes ? 0 : static_cast<std::uint32_t>(nodes);
    }
    return subtrees_[0].triangles <= kernels::kMaxWideTriangles;
  }

  // Holds the box of every part that spatial_split.cpp cut from the triangle: those stick out of
  // the triangle's own box by up to 2^-18 of its longest side, because the interval into which a
  // hit is clamped is padded by the distance to the whole triangle, and not to the part.
  Box triangle_box(std::uint32_t place) const {
    const kernels::LeafTriangle& t = from_.triangles[place];
    Box box;
    box.add(float4(t.a));
    box.add(float4(t.b));
    box.add(float4(t.c));
    float side = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
      side = std::max<float>(side, box.upper[axis] - box.lower[axis]);
    }
    const float margin = side * 0x1p-18f;
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] -= margin;
      box.upper[axis] += margin;
    }
    return box;
  }

  static void narrow(Box& box, const Box& to) {
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = std::max<float>(box.lower[axis], to.lower[axis]);
      box.upper[axis] = std::min<float>(box.upper[axis], to.upper[axis]);
    }
  }

  // Adds the triangles of a leaf slot, or of all leaf slots of a small subtree.
  void collect(const Node& node, int slot, Leaf& leaf) const {
    const std::uint32_t first = node.first_triangle + (node.meta[slot] & 31u);
    const auto count = static_cast<unsigned>(std::popcount(node.meta[slot] >> 5 & 7u));
    Box box;
    for (std::uint32_t i = 0; i < count; ++i) {
      leaf.triangles[leaf.count++] = first + i;
      box.add(triangle_box(first + i));
    }
    narrow(box, quantised_box(node, slot));
    leaf.box.add(box);
  }

  void collect_all(const Node& node, Leaf& leaf) const {
    std::uint32_t child = node.first_child;
    for (int slot = 0; slot < kChildren; ++slot) {
      if ((node.inner_mask >> slot) & 1) {
        collect_all(from_.nodes[child++], leaf);
      } else if (node.meta[slot] != 0) {
        collect(node, slot, leaf);
      }
    }
  }

  // A leaf costs its surface times one test of up to eight triangles: two are merged where the
  // surface of both is less than the sum.
  static std::size_t merge(std::array<Leaf, kChildren>& leaves, std::size_t count) {
    for (bool merged = true; merged;) {
      merged = false;
      float best = 0.0f;
      std::size_t best_a = 0, best_b = 0;
      for (std::size_t a = 0; a < count; ++a) {
        for (std::size_t b = a + 1; b < count; ++b) {
          if (leaves[a].count + leaves[b].count > kWideLanes) continue;
          Box both = leaves[a].box;
          both.add(leaves[b].box);
          const float gain =
              leaves[a].box.half_area() + leaves[b].box.half_area() - both.half_area();
          if (gain > best) {
            best = gain;
            best_a = a;
            best_b = b;
            merged = true;
          }
        }
      }
      if (!merged) break;
      Leaf& a = leaves[best_a];
      Leaf& b = leaves[best_b];
      if (b.box.half_area() > a.box.half_area()) a.slot = b.slot;
      a.box.add(b.box);
      std::copy_n(b.triangles.begin(), b.count, a.triangles.begin() + a.count);
      a.count += b.count;
      b = leaves[--count];
    }
    return count;
  }

  void write_leaf(const Leaf& leaf, std::uint32_t place) {
    float* row = to_.leaves.data() + std::uint64_t{place} * kernels::kLeafRows;
    for (std::uint32_t i = 0; i < leaf.count; ++i) {
      const kernels::LeafTriangle& t = from_.triangles[leaf.triangles[i]];
      const float values[kernels::kLeafRows] = {t.a.x,
                                                t.a.y,
                                                t.a.z,
                                                t.b.x,
                                                t.b.y,
                                                t.b.z,
                                                t.c.x,
                                                t.c.y,
                                                t.c.z,
                                                std::bit_cast<float>(t.triangle),
                                                std::bit_cast<float>(t.flags),
                                                std::bit_cast<float>(t.geometry)};
      for (std::uint32_t r = 0; r < kernels::kLeafRows; ++r) {
        // Indices are moved as bits: a float register might quiet a NaN.
        std::memcpy(&row[r * leaf.count + i], &values[r], sizeof(float));
      }
    }
  }

  static void set_child(WideNode& node, int slot, const Box& box, kernels::WideRef ref) {
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[axis][0][slot] = box.lower[axis];
      node.planes[axis][1][slot] = box.upper[axis];
    }
    node.child[slot] = ref;
  }

  // Writes the subtree of the octree's node `index` to wide node `to`; `below` is where the nodes
  // under it begin, `place` where its triangles do. Returns its box.
  Box write(std::uint32_t index, std::uint32_t to, std::uint32_t below, std::uint32_t place,
            float least_extent) {
    const Node& node = from_.nodes[index];
    WideNode& wide = to_.nodes[to];
    constexpr float kFar = 1e30f;  // beyond all coordinates; infinity less infinity is no number
    for (int slot = 0; slot < kChildren; ++slot) {
      for (int axis = 0; axis < 3; ++axis) {
        wide.planes[axis][0][slot] = kFar;
        wide.planes[axis][1][slot] = -kFar;
      }
      wide.child[slot] = kernels::kLeafRef;
    }

    std::array<Leaf, kChildren> leaves;
    std::size_t leaf_count = 0;
    struct Inner {
      std::uint32_t index, to, below, place;
      int slot;
      Box box;
    };
    std::array<Inner, kChildren> inner;
    std::size_t inner_count = 0;
    std::uint32_t child = node.first_child;
    for (int slot = 0; slot < kChildren; ++slot) {
      if ((node.inner_mask >> slot) & 1) {
        if (subtrees_[child].wide_nodes == 0) {
          Leaf& leaf = leaves[leaf_count++] = Leaf{};
          leaf.slot = slot;
          collect_all(from_.nodes[child], leaf);
          narrow(leaf.box, quantised_box(node, slot));
        } else {
          inner[inner_count++] = {child, 0, 0, 0, slot, {}};
        }
        ++child;
      } else if (node.meta[slot] != 0) {
        Leaf& leaf = leaves[leaf_count++] = Leaf{};
        leaf.slot = slot;
        collect(node, slot, leaf);
      }
    }
    leaf_count = merge(leaves, leaf_count);

    Box bounds;
    for (std::size_t i = 0; i < leaf_count; ++i) {
      const Leaf& leaf = leaves[i];
      write_leaf(leaf, place);
      set_child(wide, leaf.slot, leaf.box, kernels::kLeafRef | (leaf.count - 1) << 27 | place);
      place += leaf.count;
      bounds.add(leaf.box);
    }
    std::uint32_t next = below + static_cast<std::uint32_t>(inner_count);
    for (std::size_t i = 0; i < inner_count; ++i) {
      const Subtree& subtree = subtrees_[inner[i].index];
      inner[i].to = below + static_cast<std::uint32_t>(i);
      inner[i].below = next;
      inner[i].place = place;
      next += subtree.wide_nodes - 1;
      place += subtree.triangles;
    }
    // The quantised frame stands for the extent here, because the exact boxes come from below.
    float extent = least_extent;
    for (int axis = 0; axis < 3; ++axis) {
      int most = 0;
      for (int slot = 0; slot < kChildren; ++slot) {
        if (node.meta[slot] != 0) most = std::max<int>(most, node.upper[axis][slot]);
      }
      extent = std::max(extent, std::ldexp(static_cast<float>(most), node.exponent[axis]));
    }
    wide.extent = std::ldexp(extent, -19);
    const auto run = [&](std::size_t i) {
      Inner& job = inner[i];
      job.box = write(job.index, job.to, job.below, job.place, std::ldexp(extent, -10));
      narrow(job.box, quantised_box(node, job.slot));
      set_child(wide, job.slot, job.box, job.to);
    };
    if (subtrees_[index].triangles < kParallelTriangles) {
      for (std::size_t i = 0; i < inner_count; ++i) run(i);
    } else {
      tbb::parallel_for(std::size_t{0}, inner_count, run);
    }
    for (std::size_t i = 0; i < inner_count; ++i) bounds.add(inner[i].box);
    return bounds;
  }

  const kernels::OctreeView& from_;
  WideOctree& to_;
  std::vector<Subtree> subtrees_;
};

}  // namespace

kernels::WideView WideOctree::view() const {
  if (nodes.empty()) return {};
  return {nodes.data(), leaves.data(), lower, upper};
}

WideOctree make_wide(const kernels::OctreeView& octree) {
  WideOctree wide;
  Widener(octree, wide).run();
  return wide;
}

}  // namespace octrace::octree
