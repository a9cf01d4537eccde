// The topmost splits by the cells of a grid (backend/octree/top_cells.h): their ranges, and octrees
// made of them. Only scenes of very many triangles have them by default.
#include "backend/octree/top_cells.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "backend/octree/build_subtrees.h"
#include "backend/octree/builders.h"
#include "tests/support/expect_brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/large_meshes.h"

namespace octrace::tests {
namespace {

using kernels::Vec3;

constexpr unsigned kThreads[] = {1, 2, 3, 8};

constexpr std::uint32_t kUnit = 64;

// With one triangle a cell there is no room for the grids of several threads.
octree::TopOptions with_cells(std::uint32_t triangles_a_cell) {
  octree::TopOptions options;
  options.least_for_cells = 1;
  options.triangles_a_cell = triangles_a_cell;
  options.least_cells = 2;
  return options;
}

struct Split {
  std::vector<octree::LooseReference> references;
  octree::TopRange root;
  bool done = false;
  std::vector<const octree::TopRange*> ranges;  // that are not split

  Split(const octree::BuildInput& input, const octree::TopOptions& options, unsigned threads)
      : references(input.triangles.size()) {
    root.count = static_cast<std::uint32_t>(input.triangles.size());
    root.room = static_cast<std::uint32_t>(double{options.duplicates} * root.count);
    tbb::task_arena(static_cast<int>(threads)).execute([&] {
      done = octree::split_by_cells(input, options, kUnit, root, references.data());
    });
    if (done) list(root);
  }

 private:
  void list(const octree::TopRange& range) {
    if (range.lower == nullptr) {
      ranges.push_back(&range);
      return;
    }
    EXPECT_GT(range.count, kUnit);
    EXPECT_EQ(range.lower->first, range.first);
    EXPECT_EQ(range.upper->first, range.first + range.lower->count);
    EXPECT_EQ(range.count, range.lower->count + range.upper->count);
    EXPECT_EQ(range.room, range.lower->room + range.upper->room);
    EXPECT_EQ(range.depth + 1, range.lower->depth);
    EXPECT_EQ(range.depth + 1, range.upper->depth);
    for (int i : {0, 1, 2, 4, 5, 6}) {
      EXPECT_EQ(range.bounds.box[i],
                std::min(range.lower->bounds.box[i], range.upper->bounds.box[i]));
    }
    list(*range.lower);
    list(*range.upper);
  }
};

struct OctreeCells : testing::TestWithParam<std::size_t> {
  // As many threads as are asked for, on machines of fewer cores as well.
  tbb::global_control more{tbb::global_control::max_allowed_parallelism, 8};
  std::string name = large_meshes()[GetParam()].name;
  Mesh mesh = large_meshes()[GetParam()].make();
};

TEST_P(OctreeCells, RangesHoldAllReferences) {
  const octree::BuildInput input = mesh.input();
  struct Case {
    int sah_depth;
    std::uint32_t triangles_a_cell;
  };
  for (const auto& [sah_depth, triangles_a_cell] : {Case{64, 8}, Case{64, 1}, Case{3, 1}}) {
    octree::TopOptions options = with_cells(triangles_a_cell);
    options.sah_depth = sah_depth;
    options.duplicates = 0.0f;  // or some are to be cut at once
    std::vector<octree::LooseReference> expected;
    for (const unsigned threads : kThreads) {
      const Split split(input, options, threads);
      // Centres that are one, or so near that their distance has no inverse.
      ASSERT_EQ(split.done, name != "denormals" && name != "one_place" && name != "one_point");
      if (!split.done) return;
      EXPECT_EQ(split.ranges.size() > 1, split.root.count > kUnit);
      if (name.starts_with("dust") && sah_depth == 64) {
        EXPECT_GE(split.ranges.size(), split.root.count / kUnit);
      }
      std::uint32_t next = 0;
      for (const octree::TopRange* range : split.ranges) {
        ASSERT_EQ(range->first, next);
        ASSERT_GT(range->count, 0u);
        ASSERT_LE(range->depth, sah_depth);
        octree::Box bounds, centres;
        for (std::uint32_t i = next; i < next + range->count; ++i) {
          const octree::LooseReference& reference = split.references[i];
          // In the order of the triangles.
          if (i > next) {
            ASSERT_LT(split.references[i - 1].triangle, reference.triangle);
          }
          ASSERT_LT(reference.triangle, split.root.count);
          ASSERT_EQ(reference.corners.a, input.triangles[reference.triangle].a);
          const octree::Box box = octree::triangle_box(input, reference.triangle);
          bounds.add(box);
          centres.add(box.centre2());
        }
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(range->bounds.lower(axis), bounds.lower[axis]);
          EXPECT_EQ(range->bounds.upper(axis), bounds.upper[axis]);
          EXPECT_EQ(range->bounds.centres[axis], centres.lower[axis]);
          EXPECT_EQ(-range->bounds.centres[4 + axis], centres.upper[axis]);
        }
        next += range->count;
      }
      EXPECT_EQ(next, split.root.count);
      if (threads == 1) expected = split.references;
      EXPECT_EQ(std::memcmp(split.references.data(), expected.data(),
                            expected.size() * sizeof expected[0]),
                0)
          << threads << " threads";
    }
  }
}

octree::Octree build(const octree::BuildInput& input, const octree::TopOptions& options,
                     unsigned threads) {
  octree::Octree octree;
  octree.triangles.reserve(2 * input.triangles.size());
  octree.triangles.resize(input.triangles.size());
  auto* const references = reinterpret_cast<octree::LooseReference*>(octree.triangles.data());
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    const octree::TopTree top = octree::split_top(input, options, references);
    EXPECT_TRUE(octree::build_subtrees(top, options, kernels::kMaxLeafTriangles, input, references,
                                       octree));
  });
  return octree;
}

bool same(const octree::Octree& a, const octree::Octree& b) {
  return a.nodes.size() == b.nodes.size() && a.triangles.size() == b.triangles.size() &&
         std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof a.nodes[0]) == 0 &&
         std::memcmp(a.triangles.data(), b.triangles.data(),
                     a.triangles.size() * sizeof a.triangles[0]) == 0;
}

// The chain is too deep for any tree of splits (octree_subtrees_test.cpp).
TEST_P(OctreeCells, OctreesAreSoundAndTheSameForAnyThreadCount) {
  if (name == "chain") return;
  octree::Octree expected;
  for (const unsigned threads : kThreads) {
    octree::Octree octree = build(mesh.input(), with_cells(8), threads);
    if (threads > 1) {
      EXPECT_TRUE(same(octree, expected)) << threads << " threads";
      continue;
    }
    const util::Result<void> ok = octree::verify(octree, mesh.input());
    EXPECT_TRUE(ok) << ok.error().to_string();
    expect_brute_force(mesh, {&octree, 1}, scaled(200));
    expected = std::move(octree);
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, OctreeCells, testing::Range<std::size_t>(0, large_meshes().size()),
                         [](const auto& test) { return large_meshes()[test.param].name; });

// Which of two zeros is the less depends on their order, and the bits of nodes on their sign.
TEST(OctreeCellsOfZeros, HaveOneSign) {
  const Mesh mesh = make_mesh("zeros", 3000, [](std::uint32_t, int, std::mt19937_64& random) {
    constexpr float kValues[] = {-1.0f, -0.0f, 0.0f, 1.0f};
    return Vec3(kValues[random() % 4], kValues[random() % 4], kValues[random() % 4]);
  });
  octree::TopOptions options = with_cells(8);
  options.duplicates = 0.0f;
  const Split split(mesh.input(), options, 1);
  ASSERT_TRUE(split.done);
  ASSERT_GT(split.ranges.size(), 8u);
  int zeros = 0;
  for (const octree::TopRange* range : split.ranges) {
    for (const float corner : range->bounds.box) {
      if (corner != 0.0f) continue;
      ++zeros;
      EXPECT_FALSE(std::signbit(corner));
    }
  }
  EXPECT_GT(zeros, 8);
}

// Dust, more of it in a corner with a floor, a wall and a beam, of which a sample of every fourth
// triangle sees none.
Mesh make_room_in_a_corner() {
  return make_mesh("room_in_a_corner", 30000,
                   [centre = Vec3()](std::uint32_t i, int c, std::mt19937_64& r) mutable {
                     if (i % 4 == 1 && i < 1200) {
                       const std::uint32_t k = i / 4;
                       const float at = static_cast<float>(k / 6) / 50.0f;
                       const bool far = (k + static_cast<std::uint32_t>(c)) % 2 != 0;
                       const float across = far ? 1.0f : 0.0f;
                       if (k % 3 == 0) return 0.3f * Vec3(c == 0 ? 0.0f : 1.0f, at, across);
                       if (k % 3 == 1) return 0.3f * Vec3(at, c == 1 ? 0.0f : 1.0f, across);
                       return 0.3f * Vec3(c == 2 ? 1.0f : 0.0f, across, c == 1 ? 1.0f : at);
                     }
                     const Vec3 v(uniform(r), uniform(r), uniform(r));
                     if (c == 0) centre = i % 4 == 3 ? 0.3f * v : v;
                     return centre + 0.003f * v;
                   });
}

// Ranges that call for cuts are left whole, for those who make them.
TEST(OctreeCellsOfARoomInACorner, EndWhereCutsAreCalledFor) {
  const Mesh mesh = make_room_in_a_corner();
  const octree::BuildInput input = mesh.input();
  octree::TopOptions options = with_cells(8);
  const auto largest = [&] {
    const Split split(input, options, 2);
    EXPECT_TRUE(split.done);
    EXPECT_GT(split.ranges.size(), 20u);
    std::uint32_t most = 0;
    for (const octree::TopRange* range : split.ranges) most = std::max(most, range->count);
    return most;
  };
  EXPECT_GT(largest(), 300u);
  EXPECT_GT(build(input, options, 2).triangles.size(), mesh.triangles.size());
  options.duplicates = 0.0f;
  EXPECT_LT(largest(), 300u);
  EXPECT_EQ(build(input, options, 2).triangles.size(), mesh.triangles.size());
}

// Scenes that are to be cut at once have no use for cells, and are not passed over for them.
TEST(OctreeCellsOfARoom, AreNotMade) {
  for (const LargeMesh& large : large_meshes()) {
    if (large.name != "room") continue;
    const Mesh mesh = large.make();
    octree::TopOptions options = with_cells(8);
    EXPECT_FALSE(Split(mesh.input(), options, 2).done);
    options.duplicates = 0.0f;
    EXPECT_TRUE(Split(mesh.input(), options, 2).done);
    options.sah_depth = 0;
    EXPECT_FALSE(Split(mesh.input(), options, 2).done);
  }
}

TEST(OctreeCellsOfDust, AreNoMoreThanAskedFor) {
  const Mesh mesh = make_dust(100000);
  octree::TopOptions options = with_cells(8);
  options.most_cells = 64;
  const Split split(mesh.input(), options, 3);
  ASSERT_TRUE(split.done);
  EXPECT_GT(split.ranges.size(), 8u);
  EXPECT_LE(split.ranges.size(), 64u);
}

// Sums of corners that overflow.
TEST(OctreeCellsOfInfiniteCentres, AreNotMade) {
  for (const int axes : {1, 2, 3}) {
    const Mesh mesh = make_mesh("infinite", 1000, [&](std::uint32_t, int, std::mt19937_64& r) {
      Vec3 v(uniform(r), uniform(r), uniform(r));
      for (int axis = 0; axis < axes; ++axis) v[axis] = 3e38f;
      return v;
    });
    octree::TopOptions options = with_cells(8);
    options.duplicates = 0.0f;
    EXPECT_FALSE(Split(mesh.input(), options, 2).done);
  }
}

}  // namespace
}  // namespace octrace::tests
