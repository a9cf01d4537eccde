// Re-insertion (backend/octree/reinsert.h) of binary trees of triangles.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "backend/octree/build_binary.h"
#include "backend/octree/builders.h"
#include "backend/octree/reinsert.h"
#include "tests/support/large_meshes.h"

namespace octrace::tests {
namespace {

using kernels::Vec3;
using octree::BinaryNode;
using octree::BinaryTree;

// Triangles of all sizes, some as large as the scene: nodes overlap, and there is much to gain.
Mesh make_clutter(std::uint32_t count) {
  Vec3 centre;
  float size = 0.0f;
  return make_mesh("clutter", count, [&](std::uint32_t, int c, std::mt19937_64& random) {
    if (c == 0) {
      centre = Vec3(uniform(random), uniform(random), uniform(random));
      size = std::exp2(-8.0f * uniform(random));
    }
    return centre + size * (Vec3(uniform(random), uniform(random), uniform(random)) - 0.5f);
  });
}

BinaryTree binary_tree(const octree::BuildInput& input) {
  octree::BinaryOptions options;
  options.duplicates = 0.0f;
  return octree::build_binary(input, options);
}

struct Survey {
  std::vector<std::uint32_t> triangles;
  double surface = 0.0;
  bool tight = true;
};

void survey(const BinaryNode* nodes, std::uint32_t index, const octree::BuildInput& input,
            Survey& all) {
  const BinaryNode& node = nodes[index];
  all.surface += double{node.half_area()};
  octree::Box box;
  if (node.leaf()) {
    all.triangles.push_back(node.triangle());
    box = octree::triangle_box(input, node.triangle());
  } else {
    for (const std::uint32_t child : {2 * node.child, 2 * node.child + 1}) {
      survey(nodes, child, input, all);
      const BinaryNode& c = nodes[child];
      box.add(octree::Float4{c.lower[0], c.lower[1], c.lower[2], 0.0f});
      box.add(octree::Float4{c.upper[0], c.upper[1], c.upper[2], 0.0f});
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    all.tight &= node.lower[axis] == box.lower[axis] && node.upper[axis] == box.upper[axis];
  }
}

Survey survey(const BinaryTree& tree, const octree::BuildInput& input) {
  Survey all;
  survey(tree.nodes.data(), BinaryTree::kRoot, input, all);
  std::sort(all.triangles.begin(), all.triangles.end());
  return all;
}

// The same bytes wherever a tree has nodes; others were never written.
bool same(const BinaryTree& a, const BinaryTree& b, std::uint32_t index = BinaryTree::kRoot) {
  const BinaryNode &x = a.nodes[index], &y = b.nodes[index];
  if (std::memcmp(&x, &y, sizeof x) != 0) return false;
  return x.leaf() || (same(a, b, 2 * x.child) && same(a, b, 2 * x.child + 1));
}

TEST(Reinsertion, KeepsTheTreeSoundAndMakesItsSurfacesLess) {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 8);
  for (const std::uint32_t count : {2u, 3u, 4u, 100u, 5000u}) {
    const Mesh mesh = make_clutter(count);
    const octree::BuildInput input = mesh.input();
    const BinaryTree before = binary_tree(input);
    const Survey old = survey(before, input);
    ASSERT_EQ(old.triangles.size(), count);
    // By searches of one step, of many, and by those of few nodes and of none but large ones.
    std::vector<double> gains;
    for (int i = 0; i < 4; ++i) {
      octree::ReinsertOptions options;
      options.rounds = 6;
      options.steps = i == 0 ? 1 : 4096;
      if (i == 2) options.most = count / 50;
      if (i == 3) options.least_area = 0.3f * before.nodes[BinaryTree::kRoot].half_area();
      BinaryTree serial = before, parallel = before;
      options.parallel = false;
      const bool moved = octree::reinsert(serial.nodes.data(), serial.nodes.size(), options);
      options.parallel = true;
      bool moved_too = false;
      tbb::task_arena(8).execute([&] {
        moved_too = octree::reinsert(parallel.nodes.data(), parallel.nodes.size(), options);
      });
      EXPECT_EQ(moved, moved_too);
      EXPECT_TRUE(same(serial, parallel)) << count << " triangles, case " << i;
      const Survey after = survey(serial, input);
      EXPECT_EQ(after.triangles, old.triangles);
      EXPECT_TRUE(after.tight);
      EXPECT_EQ(moved, !same(serial, before));
      EXPECT_LE(after.surface, old.surface * (1.0 + 1e-6));
      gains.push_back(old.surface - after.surface);
    }
    if (count >= 100) {
      EXPECT_GT(gains[1], 0.01 * old.surface) << count;
      for (const int i : {0, 2, 3}) {
        EXPECT_LT(gains[i], 0.9 * gains[1]) << count << " triangles, case " << i;
      }
    }
  }
}

TEST(Reinsertion, LeavesAloneWhatItIsNotToMove) {
  const Mesh mesh = make_clutter(1000);
  const octree::BuildInput input = mesh.input();
  const BinaryTree before = binary_tree(input);
  const float root = before.nodes[BinaryTree::kRoot].half_area();
  octree::ReinsertOptions none, small;
  small.rounds = 6;
  small.least_area = root;
  for (const octree::ReinsertOptions& options : {none, small}) {
    BinaryTree tree = before;
    EXPECT_FALSE(octree::reinsert(tree.nodes.data(), tree.nodes.size(), options));
    EXPECT_TRUE(same(tree, before));
  }
}

}  // namespace
}  // namespace octrace::tests
