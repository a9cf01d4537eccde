#include "backend/octree/wide.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <memory>

#include "backend/octree/box.h"

namespace octrace::octree {

namespace {

using kernels::kChildren;
using kernels::kNodeUnits;
using kernels::kWideLanes;
using kernels::Node;
using kernels::WideNode;
using kernels::WideUnit;

constexpr std::uint32_t kParallelTriangles = 16384;

// Units of a leaf.
constexpr std::uint32_t leaf_units(std::uint32_t triangles) {
  constexpr std::uint32_t kBytes = kernels::kLeafRows * sizeof(float);
  return (triangles * kBytes + sizeof(WideUnit) - 1) / sizeof(WideUnit);
}

// As std::nextafter() towards minus infinity, which is a call, of what is neither NaN nor
// -infinity.
float next_below(float value) {
  if (value == 0.0f) return -std::numeric_limits<float>::denorm_min();
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return std::bit_cast<float>(value > 0.0f ? bits - 1 : bits + 1);
}

float below(double value) {
  const auto rounded = static_cast<float>(value);
  return rounded > value ? next_below(rounded) : rounded;
}

float above(double value) { return -below(-value); }

// As std::ldexp(1.0, exponent), which is a call.
double power_of_two(std::int8_t exponent) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(1023 + exponent) << 52);
}

// A leaf slot's triangles, from its meta byte: a bit for each from bit 5 on.
unsigned triangles_of(std::uint8_t meta) {
  return (meta >> 5 & 1u) + (meta >> 6 & 1u) + (meta >> 7);
}

// Stable, and without std::stable_sort's memory.
template <class T, class Less>
void sort_few(T* first, T* last, const Less& less) {
  for (T* i = first; i != last; ++i) {
    std::rotate(std::upper_bound(first, i, *i, less), i, i + 1);
  }
}

// A child's box as it was quantised. Exact: eight bits above the origin, or rounded to the nearest
// float, which is what the walk of the compressed nodes does.
Box quantised_box(const Node& node, int slot) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    const double scale = power_of_two(node.exponent[axis]);
    const double lower = node.origin[axis] + node.lower[axis][slot] * scale;
    const double upper = node.origin[axis] + node.upper[axis][slot] * scale;
    box.lower[axis] = below(lower);
    box.upper[axis] = above(upper);
  }
  box.lower[3] = box.upper[3] = 0.0f;
  return box;
}

struct Leaf {
  Box box;
  std::uint32_t count = 0;
  std::array<std::uint32_t, kWideLanes> triangles{};  // places in the octree's array
};

// Per node of the octree, children before parents.
struct Subtree {
  std::uint64_t triangles = 0;
  std::uint64_t units = 0;  // at most, with this node; of a leaf where triangles <= kWideLanes
  bool leaf() const { return triangles <= kWideLanes; }
};

class Widener {
 public:
  Widener(const kernels::OctreeView& from, WideOctree& to) : from_(from), to_(to) {}

  void run() {
    if (!measure()) return;
    // Behind the nodes comes the leaf of unused slots, and room for whole vectors to be read.
    const std::uint64_t used = std::max<std::uint64_t>(subtrees_[0].units, kNodeUnits + 1);
    if (used + kSpareUnits > kernels::kMaxWideUnits) return;
    nothing_ = kernels::kLeafRef | static_cast<std::uint32_t>(used);
    to_.units = util::HugeArray<WideUnit>(used + kSpareUnits, util::kHugePage);
    std::uint32_t next = kNodeUnits;
    Children children;
    gather(from_.nodes[0], children);
    const Box box = write(0, children, 0, next, 0.0f);
    to_.lower = {box.lower[0], box.lower[1], box.lower[2]};
    to_.upper = {box.upper[0], box.upper[1], box.upper[2]};
  }

 private:
  static constexpr std::uint32_t kSpareUnits = 2;

  // Counts, and makes sure that what follows cannot leave the array: every builder puts children
  // after their parents, so a walk downwards ends.
  bool measure() {
    const std::uint64_t count = from_.nodes.size;
    if (count == 0 || count > kernels::kMaxWideUnits) return false;
    subtrees_.resize(count);
    std::vector<std::uint8_t> height(count, 1);
    for (std::uint64_t i = count; i-- > 0;) {
      const Node& node = from_.nodes[i];
      Subtree& sum = subtrees_[i];
      std::uint64_t triangles = 0, units = kNodeUnits, child = node.first_child;
      for (int slot = 0; slot < kChildren; ++slot) {
        if ((node.inner_mask >> slot) & 1) {
          if (child <= i || child >= count) return false;
          triangles += subtrees_[child].triangles;
          units += subtrees_[child].units;
          height[i] = std::max<std::uint8_t>(height[i], height[child] + 1);
          ++child;
        } else if (node.meta[slot] != 0) {
          const auto in_leaf = triangles_of(node.meta[slot]);
          if (node.first_triangle + std::uint64_t{node.meta[slot] & 31u} + in_leaf >
              from_.triangles.size)
            return false;
          triangles += in_leaf;
          units += leaf_units(in_leaf);
        }
      }
      if (triangles == 0 || units > kernels::kMaxWideUnits || height[i] > kernels::kMaxDepth)
        return false;
      sum.triangles = triangles;
      sum.units = sum.leaf() && i != 0 ? leaf_units(static_cast<std::uint32_t>(triangles)) : units;
    }
    return true;
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
    const Float4 extent = box.upper - box.lower;
    const float side = std::max<float>({extent[0], extent[1], extent[2]});
    const float margin = side * 0x1p-18f;
    box.lower -= margin;
    box.upper += margin;
    return box;
  }

  static void narrow(Box& box, const Box& to) {
    box.lower = greater(box.lower, to.lower);
    box.upper = lesser(box.upper, to.upper);
  }

  // Adds the triangles of a leaf slot, or of all leaf slots of a small subtree.
  void collect(const Node& node, int slot, Leaf& leaf) const {
    const std::uint32_t first = node.first_triangle + (node.meta[slot] & 31u);
    const auto count = triangles_of(node.meta[slot]);
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
    std::array<float, kChildren> areas;
    for (std::size_t i = 0; i < count; ++i) areas[i] = leaves[i].box.half_area();
    for (bool merged = true; merged;) {
      merged = false;
      float best = 0.0f;
      std::size_t best_a = 0, best_b = 0;
      for (std::size_t a = 0; a < count; ++a) {
        for (std::size_t b = a + 1; b < count; ++b) {
          if (leaves[a].count + leaves[b].count > kWideLanes) continue;
          Box both = leaves[a].box;
          both.add(leaves[b].box);
          const float gain = areas[a] + areas[b] - both.half_area();
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
      a.box.add(b.box);
      std::copy_n(b.triangles.begin(), b.count, a.triangles.begin() + a.count);
      a.count += b.count;
      areas[best_a] = a.box.half_area();
      b = leaves[--count];
      areas[best_b] = areas[count];
    }
    return count;
  }

  // Returns the leaf's reference.
  kernels::WideRef write_leaf(const Leaf& leaf, std::uint32_t unit) {
    float* row = to_.units[unit].words;
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
                                                reach(leaf, t)};
      for (std::uint32_t r = 0; r < kernels::kLeafRows; ++r) {
        // Indices are moved as bits: a float register might quiet a NaN.
        std::memcpy(&row[r * leaf.count + i], &values[r], sizeof(float));
      }
    }
    return kernels::kLeafRef | (leaf.count - 1) << 28 | unit;
  }

  static float reach(const Leaf& leaf, const kernels::LeafTriangle& t) {
    Box both = leaf.box;
    both.add(float4(t.a));
    both.add(float4(t.b));
    both.add(float4(t.c));
    double most = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      most = std::max(most, double{both.upper[axis]} - double{both.lower[axis]});
    }
    return above(most);
  }

  // `padding`: the share of the node's extent in what the walk pads boxes by.
  static void set_child(WideNode& node, int slot, const Box& box, double padding,
                        kernels::WideRef ref) {
    for (int axis = 0; axis < 3; ++axis) {
      node.planes[axis][0][slot] = below(box.lower[axis] - padding);
      node.planes[axis][1][slot] = above(box.upper[axis] + padding);
    }
    node.child[slot] = ref;
  }

  // The longest side of the node's frame, because the exact boxes come from below.
  static float frame_extent(const Node& node) {
    float extent = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
      int most = 0;
      for (int slot = 0; slot < kChildren; ++slot) {
        if (node.meta[slot] != 0) most = std::max<int>(most, node.upper[axis][slot]);
      }
      extent = std::max(extent, static_cast<float>(most * power_of_two(node.exponent[axis])));
    }
    return extent;
  }

  struct Children;
  struct Inner {
    std::uint32_t index = 0, unit = 0;
    Box box;
    std::unique_ptr<Children> below;  // once gathered: by who might open it, for who writes it
  };

  struct Children {
    std::array<Leaf, kChildren> leaves;
    std::array<Inner, kChildren> inner;
    std::size_t leaf_count = 0, inner_count = 0;
    std::size_t size() const { return leaf_count + inner_count; }
  };

  void gather(const Node& node, Children& to) const {
    std::uint32_t child = node.first_child;
    for (int slot = 0; slot < kChildren; ++slot) {
      if ((node.inner_mask >> slot) & 1) {
        if (subtrees_[child].leaf()) {
          Leaf& leaf = to.leaves[to.leaf_count++] = Leaf{};
          collect_all(from_.nodes[child], leaf);
          narrow(leaf.box, quantised_box(node, slot));
        } else {
          to.inner[to.inner_count++] = {child, 0, quantised_box(node, slot), nullptr};
        }
        ++child;
      } else if (node.meta[slot] != 0) {
        Leaf& leaf = to.leaves[to.leaf_count++] = Leaf{};
        collect(node, slot, leaf);
      }
    }
    to.leaf_count = merge(to.leaves, to.leaf_count);
  }

  // Puts children's children in their place while there are slots for them, the largest first:
  // merged leaves leave half of the slots empty.
  void open(Children& children) const {
    while (true) {
      std::size_t best = kChildren;
      for (std::size_t i = 0; i < children.inner_count; ++i) {
        Inner& inner = children.inner[i];
        if (best != kChildren && inner.box.half_area() <= children.inner[best].box.half_area())
          continue;
        if (children.size() - 1 + gathered(inner).size() <= kChildren) best = i;
      }
      if (best == kChildren) return;
      const std::unique_ptr<Children> below = std::move(children.inner[best].below);
      const Box bounds = children.inner[best].box;
      children.inner[best] = std::move(children.inner[--children.inner_count]);
      for (std::size_t i = 0; i < below->inner_count; ++i) {
        narrow(below->inner[i].box, bounds);
        children.inner[children.inner_count++] = std::move(below->inner[i]);
      }
      for (std::size_t i = 0; i < below->leaf_count; ++i) {
        narrow(below->leaves[i].box, bounds);
        children.leaves[children.leaf_count++] = below->leaves[i];
      }
      children.leaf_count = merge(children.leaves, children.leaf_count);
    }
  }

  Children& gathered(Inner& inner) const {
    if (inner.below == nullptr) {
      inner.below = std::make_unique<Children>();
      gather(from_.nodes[inner.index], *inner.below);
    }
    return *inner.below;
  }

  // Writes the subtree of the octree's node `index` with the children gathered from it to unit
  // `unit`, and what is below from `next` on, which is moved behind it. Returns its box.
  Box write(std::uint32_t index, Children& children, std::uint32_t unit, std::uint32_t& next,
            float least_extent) {
    const Node& node = from_.nodes[index];
    WideNode& wide = reinterpret_cast<WideNode&>(to_.units[unit]);
    const float extent = std::max(least_extent, frame_extent(node));
    const double padding = double{extent} * 0x1p-19;
    open(children);

    // Where their order is left open, and among boxes that hold the ray's origin, the last slot
    // comes first: leaves, the largest of them to begin with, because any of them may end the walk;
    // then nodes, the smallest to begin with, because what lies around the origin is met soonest
    // there.
    const auto smaller = [](const auto& a, const auto& b) {
      return a.box.half_area() < b.box.half_area();
    };
    const auto larger = [&](const auto& a, const auto& b) { return smaller(b, a); };
    sort_few(children.inner.data(), children.inner.data() + children.inner_count, larger);
    sort_few(children.leaves.data(), children.leaves.data() + children.leaf_count, smaller);
    Box bounds;
    auto slot = static_cast<int>(children.inner_count);
    for (std::size_t i = 0; i < children.leaf_count; ++i, ++slot) {
      const Leaf& leaf = children.leaves[i];
      set_child(wide, slot, leaf.box, padding, write_leaf(leaf, next));
      next += leaf_units(leaf.count);
      bounds.add(leaf.box);
    }
    const auto run = [&](std::size_t i, std::uint32_t& place) {
      Inner& inner = children.inner[i];
      const Box box = write(inner.index, gathered(inner), inner.unit, place, extent * 0x1p-10f);
      inner.below.reset();
      narrow(inner.box, box);
      set_child(wide, static_cast<int>(i), inner.box, padding, inner.unit);
    };
    if (subtrees_[index].triangles < kParallelTriangles) {
      for (std::size_t i = 0; i < children.inner_count; ++i) {
        children.inner[i].unit = next;
        next += kNodeUnits;
        run(i, next);
      }
    } else {
      for (std::size_t i = 0; i < children.inner_count; ++i) {
        children.inner[i].unit = next;
        next += static_cast<std::uint32_t>(subtrees_[children.inner[i].index].units);
      }
      tbb::parallel_for(std::size_t{0}, children.inner_count, [&](std::size_t i) {
        std::uint32_t place = children.inner[i].unit + kNodeUnits;
        run(i, place);
      });
    }
    for (std::size_t i = 0; i < children.inner_count; ++i) bounds.add(children.inner[i].box);

    constexpr float kFar = 1e30f;  // beyond all coordinates; infinity less infinity is no number
    for (; slot < kChildren; ++slot) {
      for (int axis = 0; axis < 3; ++axis) {
        wide.planes[axis][0][slot] = kFar;
        wide.planes[axis][1][slot] = -kFar;
      }
      wide.child[slot] = nothing_;
    }
    return bounds;
  }

  const kernels::OctreeView& from_;
  WideOctree& to_;
  std::vector<Subtree> subtrees_;
  kernels::WideRef nothing_ = kernels::kLeafRef;
};

}  // namespace

kernels::WideView WideOctree::view() const { return {units.data(), lower, upper}; }

WideOctree make_wide(const kernels::OctreeView& octree) {
  WideOctree wide;
  Widener(octree, wide).run();
  return wide;
}

}  // namespace octrace::octree
