#include "tests/bench/seed_tree.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <tuple>

namespace octrace::bench {

using kernels::SeedNode;
using kernels::Triangle;
using kernels::Vec3;

namespace {

class Builder {
 public:
  Builder(std::span<const Vec3> positions, std::span<const Triangle> triangles,
          std::uint32_t threshold, SeedTree& tree)
      : positions_(positions), triangles_(triangles), threshold_(threshold), tree_(tree) {
    triangles_of_.resize(positions.size());
    for (std::uint32_t i = 0; i < triangles.size(); ++i) triangles_of_[triangles[i].a].push_back(i);
  }

  void run() {
    std::vector<std::uint32_t> vertices;
    for (std::uint32_t v = 0; v < positions_.size(); ++v) {
      if (!triangles_of_[v].empty()) vertices.push_back(v);
    }
    if (vertices.empty()) return;
    tree_.nodes.resize(1);
    fill(0, vertices, 1);
  }

 private:
  using Vertices = std::span<std::uint32_t>;

  std::array<Vertices, 2> halves(Vertices vertices, int axis) const {
    std::sort(vertices.begin(), vertices.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::tuple(positions_[a][axis], a) < std::tuple(positions_[b][axis], b);
    });
    return {vertices.first(vertices.size() / 2), vertices.subspan(vertices.size() / 2)};
  }

  void fill(std::uint32_t index, Vertices vertices, std::uint32_t depth) {
    tree_.depth = std::max(tree_.depth, depth);
    if (vertices.size() <= threshold_) return fill_leaf(index, vertices);
    std::vector<Vertices> octants;
    for (const Vertices& half : halves(vertices, 0)) {
      for (const Vertices& quarter : halves(half, 1)) {
        for (const Vertices& octant : halves(quarter, 2)) {
          if (!octant.empty()) octants.push_back(octant);
        }
      }
    }
    const auto first = static_cast<std::uint32_t>(tree_.nodes.size());
    const auto count = static_cast<std::uint32_t>(octants.size());
    tree_.nodes.resize(first + count);
    SeedNode node = empty_node(first, count);
    for (std::uint32_t i = 0; i < count; ++i) {
      fill(first + i, octants[i], depth + 1);
      add(node, tree_.nodes[first + i].lower);
      add(node, tree_.nodes[first + i].upper);
    }
    tree_.nodes[index] = node;
  }

  void fill_leaf(std::uint32_t index, Vertices vertices) {
    SeedNode node = empty_node(static_cast<std::uint32_t>(tree_.ids.size()), kernels::kSeedLeaf);
    for (const std::uint32_t vertex : vertices) {
      for (const std::uint32_t id : triangles_of_[vertex]) {
        tree_.ids.push_back(id);
        ++node.count;
        add(node, positions_[triangles_[id].a]);
        add(node, positions_[triangles_[id].b]);
        add(node, positions_[triangles_[id].c]);
      }
    }
    tree_.nodes[index] = node;
  }

  static SeedNode empty_node(std::uint32_t first, std::uint32_t count) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    return {Vec3(kInfinity), first, Vec3(-kInfinity), count};
  }

  static void add(SeedNode& node, const Vec3& point) {
    for (int axis = 0; axis < 3; ++axis) {
      node.lower[axis] = std::min(node.lower[axis], point[axis]);
      node.upper[axis] = std::max(node.upper[axis], point[axis]);
    }
  }

  std::span<const Vec3> positions_;
  std::span<const Triangle> triangles_;
  std::size_t threshold_;
  SeedTree& tree_;
  std::vector<std::vector<std::uint32_t>> triangles_of_;  // by first corner
};

}  // namespace

kernels::SeedView SeedTree::view(std::span<const Triangle> triangles,
                                 std::span<const Vec3> positions) const {
  return {{nodes.data(), nodes.size()},
          {ids.data(), ids.size()},
          {triangles.data(), triangles.size()},
          {positions.data(), positions.size()}};
}

SeedTree build_seed_tree(std::span<const Vec3> positions, std::span<const Triangle> triangles,
                         std::uint32_t threshold) {
  SeedTree tree;
  Builder(positions, triangles, threshold, tree).run();
  return tree;
}

}  // namespace octrace::bench
