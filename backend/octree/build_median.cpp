// The octree of Wang, Ren, Zhao and Sun 2012, "Fast parallel algorithm of triangle intersection
// based on GPU": sort the vertices by x, y and z; split at the median in x, each half in y, each
// quarter in z; eight children with tight boxes; recurse until a node has at most `leaf` vertices;
// a leaf holds the triangles of its vertices.
//
// What the paper leaves open, and how it is closed here:
// - A triangle whose corners lie in several leaves: it belongs to the leaf of its first corner
// only,
//   and boxes are those of the triangles, not of the vertices. So no triangle is tested twice and
//   none can be missed.
// - Equal coordinates: vertices are ordered by (coordinate, index), so a median always splits, and
//   the tree does not depend on the sorting algorithm or the number of threads.
// - Depth: splits are by rank, so each level divides the count by eight and the depth is at most
//   ceil(log8(vertices)) <= 11. A leaf with more triangles than a child slot holds (a vertex may
//   have any number) becomes a subtree of even chunks, at most 11 levels more: below kMaxDepth.
// - The median needs no full sort: selection (std::nth_element) leaves the same halves.
// - Vertices that no triangle begins at take no part; children without triangles are left out.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <memory>
#include <numeric>

#include "backend/octree/builders.h"

namespace octrace::octree {

namespace {

constexpr std::size_t kParallelVertices = 4096;

class MedianBuilder {
 public:
  MedianBuilder(const BuildInput& input, std::uint32_t leaf, TreeArena& arena,
                std::vector<std::uint32_t>& ids)
      : input_(input), leaf_(leaf), arena_(arena), ids_(ids) {}

  TreeNode* build() {
    group_by_first_corner();
    if (ids_.empty()) return nullptr;
    split_range(root_, 0, vertices_.size());
    order_triangles();
    const Child root = make_child(root_);
    if (root.node != nullptr) return root.node;
    TreeNode* node = arena_.allocate();
    encode({&root, 1}, Slots{}, *node);
    return node;
  }

 private:
  // A range of vertices_, and after order_triangles() a range of ids_. Ranges form the tree.
  struct Range {
    std::size_t first = 0, last = 0;
    std::array<std::unique_ptr<Range>, 8> children;
    bool leaf = true;
  };

  void group_by_first_corner() {
    std::vector<std::uint32_t> count(input_.positions.size(), 0);
    for (const kernels::Triangle& t : input_.triangles) ++count[t.a];
    for (std::uint32_t v = 0; v < count.size(); ++v) {
      if (count[v] != 0) vertices_.push_back(v);
    }
    first_triangle_.assign(input_.positions.size() + 1, 0);
    std::inclusive_scan(count.begin(), count.end(), first_triangle_.begin() + 1);
    triangles_by_vertex_.resize(input_.triangles.size());
    std::vector<std::uint32_t> next(first_triangle_.begin(), first_triangle_.end() - 1);
    for (std::uint32_t t = 0; t < input_.triangles.size(); ++t) {
      triangles_by_vertex_[next[input_.triangles[t].a]++] = t;
    }
    ids_.resize(input_.triangles.size());
  }

  // Moves the lower half of [first, last) along the axis to its front; returns the middle.
  std::size_t split(std::size_t first, std::size_t last, int axis) {
    const std::size_t middle = first + (last - first) / 2;
    const auto begin = vertices_.begin();
    std::nth_element(begin + first, begin + middle, begin + last,
                     [&](std::uint32_t a, std::uint32_t b) {
                       const float pa = input_.positions[a][axis], pb = input_.positions[b][axis];
                       return pa < pb || (pa == pb && a < b);
                     });
    return middle;
  }

  void split_range(Range& range, std::size_t first, std::size_t last) {
    range.first = first;
    range.last = last;
    if (last - first <= leaf_) return;
    range.leaf = false;
    // Bit 2 of a child's index is its half in x, bit 1 in y, bit 0 in z.
    std::array<std::size_t, 9> bounds{};
    bounds[0] = first;
    bounds[8] = last;
    bounds[4] = split(first, last, 0);
    bounds[2] = split(first, bounds[4], 1);
    bounds[6] = split(bounds[4], last, 1);
    for (int i = 1; i < 8; i += 2) bounds[i] = split(bounds[i - 1], bounds[i + 1], 2);
    const auto child = [&](std::size_t i) {
      if (bounds[i] == bounds[i + 1]) return;
      range.children[i] = std::make_unique<Range>();
      split_range(*range.children[i], bounds[i], bounds[i + 1]);
    };
    if (last - first < kParallelVertices) {
      for (std::size_t i = 0; i < 8; ++i) child(i);
    } else {
      tbb::parallel_for(std::size_t{0}, std::size_t{8}, child);
    }
  }

  // ids_ gets the triangles in the order of their vertices; first_of_ where each vertex's begin.
  void order_triangles() {
    first_of_.resize(vertices_.size() + 1);
    std::uint32_t next = 0;
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      first_of_[i] = next;
      const std::uint32_t v = vertices_[i];
      for (std::uint32_t k = first_triangle_[v]; k < first_triangle_[v + 1]; ++k) {
        ids_[next++] = triangles_by_vertex_[k];
      }
    }
    first_of_.back() = next;
  }

  Child make_child(const Range& range) {
    if (range.leaf) return make_chunk(first_of_[range.first], first_of_[range.last]);
    std::array<Child, 8> all;
    const auto child = [&](std::size_t i) {
      if (range.children[i]) all[i] = make_child(*range.children[i]);
    };
    if (range.last - range.first < kParallelVertices) {
      for (std::size_t i = 0; i < 8; ++i) child(i);
    } else {
      tbb::parallel_for(std::size_t{0}, std::size_t{8}, child);
    }
    std::vector<Child> children;
    Slots slots{};
    for (std::size_t i = 0; i < 8; ++i) {
      if (!range.children[i]) continue;
      // An octant has x in bit 0, a range's index in bit 2.
      slots[children.size()] = static_cast<std::uint8_t>((i >> 2 & 1) | (i & 2) | (i & 1) << 2);
      children.push_back(all[i]);
    }
    return finish(children, slots);
  }

  Child finish(std::span<const Child> children, const Slots& slots) {
    Child result;
    for (const Child& child : children) result.box.add(child.box);
    result.node = arena_.allocate();
    encode(children, slots, *result.node);
    return result;
  }

  // The triangles ids_[first, last): one leaf where they fit a slot, else even chunks of them.
  Child make_chunk(std::uint32_t first, std::uint32_t last) {
    const std::uint32_t count = last - first;
    if (count <= kernels::kMaxLeafTriangles) {
      Child leaf;
      leaf.leaf_first = first;
      leaf.leaf_count = count;
      for (std::uint32_t i = first; i < last; ++i) leaf.box.add(triangle_box(input_, ids_[i]));
      return leaf;
    }
    std::vector<Child> children;
    Box box;
    const std::uint32_t parts = std::min<std::uint32_t>(
        8, (count + kernels::kMaxLeafTriangles - 1) / kernels::kMaxLeafTriangles);
    for (std::uint32_t i = 0; i < parts; ++i) {
      const auto at = [&](std::uint32_t k) {
        return first + static_cast<std::uint32_t>(std::uint64_t{count} * k / parts);
      };
      children.push_back(make_chunk(at(i), at(i + 1)));
      box.add(children.back().box);
    }
    return finish(children, slots_by_octant(children, box));
  }

  const BuildInput& input_;
  const std::size_t leaf_;
  TreeArena& arena_;
  std::vector<std::uint32_t>& ids_;
  std::vector<std::uint32_t> vertices_;        // those that a triangle begins at
  std::vector<std::uint32_t> first_triangle_;  // by vertex, into triangles_by_vertex_
  std::vector<std::uint32_t> triangles_by_vertex_;
  std::vector<std::uint32_t> first_of_;  // by position in vertices_, into ids_
  Range root_;
};

}  // namespace

TreeNode* build_median(const BuildInput& input, std::uint32_t leaf_vertices, TreeArena& arena,
                       std::vector<std::uint32_t>& ids) {
  return MedianBuilder(input, leaf_vertices, arena, ids).build();
}

}  // namespace octrace::octree
