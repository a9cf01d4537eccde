// Scenes of several subtrees (backend/octree/top_tree.h): the units that the top is split into,
// with and without cuts, and the octrees made of them. The other tests' meshes are smaller than one
// subtree.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "backend/octree/build_subtrees.h"
#include "backend/octree/builders.h"
#include "backend/octree/top_tree.h"
#include "tests/support/expect_brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/large_meshes.h"

namespace octrace::tests {
namespace {

using kernels::Vec3;

constexpr unsigned kThreads[] = {1, 2, 3, 8};

template <class T, class Allocator>
bool same_bytes(const std::vector<T, Allocator>& a, const std::vector<T, Allocator>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

octree::Octree build(const Mesh& mesh, bool cuts, unsigned threads = 1,
                     std::uint32_t leaf = kernels::kMaxLeafTriangles) {
  const octree::BuildInput input = mesh.input();
  octree::Octree octree;
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    octree::build_sah(input, {leaf, false, cuts}, octree);
  });
  return octree;
}

struct OctreeSubtrees : testing::TestWithParam<std::size_t> {
  // As many threads as are asked for, on machines of fewer cores as well.
  tbb::global_control more{tbb::global_control::max_allowed_parallelism, 8};
  Mesh mesh = large_meshes()[GetParam()].make();
};

struct Units {
  std::vector<octree::LooseReference> references;
  octree::TopTree top;
  std::vector<const octree::TopRange*> units;

  Units(const octree::BuildInput& input, const octree::TopOptions& options, unsigned threads)
      : references(input.triangles.size()) {
    tbb::task_arena(static_cast<int>(threads)).execute([&] {
      top = octree::split_top(input, options, references.data());
    });
    list(*top.root);
  }

  std::vector<octree::LooseReference> of(const octree::TopRange& unit) const {
    std::vector<octree::LooseReference> all(references.begin() + unit.first,
                                            references.begin() + unit.first + unit.count);
    all.insert(all.end(), unit.parts.begin(), unit.parts.end());
    return all;
  }

 private:
  void list(const octree::TopRange& range) {
    if (range.lower == nullptr) {
      units.push_back(&range);
      return;
    }
    list(*range.lower);
    list(*range.upper);
  }
};

octree::Box box_of(const octree::LooseReference& reference) {
  octree::Box box;
  box.add(octree::Float4{reference.lower[0], reference.lower[1], reference.lower[2], 0.0f});
  box.add(octree::Float4{-reference.negated_upper[0], -reference.negated_upper[1],
                         -reference.negated_upper[2], 0.0f});
  return box;
}

bool same(const octree::Box& a, const octree::Box& b) {
  for (int axis = 0; axis < 3; ++axis) {
    if (a.lower[axis] != b.lower[axis] || a.upper[axis] != b.upper[axis]) return false;
  }
  return true;
}

bool contains(const octree::Box& box, const Vec3& point) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!(point[axis] >= box.lower[axis] && point[axis] <= box.upper[axis])) return false;
  }
  return true;
}

TEST_P(OctreeSubtrees, UnitsHoldAllReferences) {
  const octree::BuildInput input = mesh.input();
  const std::size_t count = input.triangles.size();
  for (const int sah_depth : {64, 3, 0}) {
    octree::TopOptions options;
    options.sah_depth = sah_depth;
    options.duplicates = 0.0f;
    std::vector<std::uint32_t> expected;
    for (const unsigned threads : kThreads) {
      const Units units(input, options, threads);
      EXPECT_EQ(units.units.size() > 1, count > 64);
      std::uint32_t next = 0;
      std::vector<std::uint32_t> triangles;
      for (const octree::TopRange* unit : units.units) {
        ASSERT_EQ(unit->first, next);
        ASSERT_EQ(unit->place, next);
        ASSERT_GT(unit->count, 0u);
        ASSERT_EQ(unit->count, unit->size);
        ASSERT_LE(unit->count, std::clamp<std::size_t>(count / 64, 64, octree::kMostInUnit));
        next += unit->count;
        octree::Box bounds;
        for (const octree::LooseReference& reference : units.of(*unit)) {
          triangles.push_back(reference.triangle);
          ASSERT_LT(reference.triangle, count);
          ASSERT_EQ(reference.corners.a, input.triangles[reference.triangle].a);
          bounds.add(octree::triangle_box(input, reference.triangle));
        }
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(unit->bounds.lower(axis), bounds.lower[axis]);
          EXPECT_EQ(unit->bounds.upper(axis), bounds.upper[axis]);
        }
      }
      EXPECT_EQ(next, count);
      if (threads == 1) expected = triangles;
      EXPECT_EQ(triangles, expected) << threads << " threads";
      std::sort(triangles.begin(), triangles.end());
      for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(triangles[i], i);
    }
  }
}

// A point of the triangle where a box of one of its parts ends.
Vec3 point_at_an_end(const Vec3 (&corners)[3], const octree::Box& box, std::mt19937_64& random) {
  const int axis = static_cast<int>(random() % 3);
  const float end = random() % 2 != 0 ? box.lower[axis] : box.upper[axis];
  Vec3 ends[2] = {corners[0], corners[0]};
  int found = 0;
  for (int i = 0; i < 3 && found < 2; ++i) {
    const Vec3 &a = corners[i], &b = corners[(i + 1) % 3];
    if ((a[axis] < end) == (b[axis] < end)) continue;
    ends[found++] = a + (end - a[axis]) / (b[axis] - a[axis]) * (b - a);
  }
  return ends[0] + uniform(random) * (ends[1] - ends[0]);
}

// Every point of a triangle lies in the box of one of its parts, and so does every place to which a
// computed hit may stray from it (spatial_split.h).
TEST_P(OctreeSubtrees, PartsCoverTheirTriangles) {
  const octree::BuildInput input = mesh.input();
  const auto count = static_cast<std::uint32_t>(input.triangles.size());
  octree::TopOptions options;
  options.least_overlap = 0.0f;
  std::vector<octree::LooseReference> expected;
  for (const unsigned threads : kThreads) {
    const Units units(input, options, threads);
    std::vector<std::vector<octree::Box>> boxes(count);
    std::vector<octree::LooseReference> all;
    for (const octree::TopRange* unit : units.units) {
      ASSERT_EQ(unit->place, all.size());
      ASSERT_LE(unit->size, octree::kMostInUnit);
      octree::Box bounds;
      for (const octree::LooseReference& reference : units.of(*unit)) {
        ASSERT_LT(reference.triangle, count);
        boxes[reference.triangle].push_back(box_of(reference));
        bounds.add(boxes[reference.triangle].back());
        all.push_back(reference);
      }
      ASSERT_EQ(unit->size, all.size() - unit->place);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(unit->bounds.lower(axis), bounds.lower[axis]);
        EXPECT_EQ(unit->bounds.upper(axis), bounds.upper[axis]);
      }
    }
    EXPECT_LE(all.size(), count * (1.0 + options.duplicates));
    if (mesh.name == "room") {
      EXPECT_GT(all.size(), count + 300u);
    }
    for (octree::LooseReference& reference : all) reference.note = 0;  // of whoever split last
    if (threads > 1) {
      ASSERT_TRUE(same_bytes(all, expected)) << threads << " threads";
      continue;
    }
    expected = all;
    std::mt19937_64 random(seed());
    for (std::uint32_t i = 0; i < count; ++i) {
      ASSERT_FALSE(boxes[i].empty());
      if (boxes[i].size() == 1) {
        ASSERT_TRUE(same(boxes[i][0], octree::triangle_box(input, i)));
        continue;
      }
      const kernels::Triangle& t = input.triangles[i];
      const Vec3 corners[] = {input.positions[t.a], input.positions[t.b], input.positions[t.c]};
      const octree::Box whole = octree::triangle_box(input, i);
      float side = 0.0f;
      for (int axis = 0; axis < 3; ++axis) {
        side = std::max(side, whole.upper[axis] - whole.lower[axis]);
      }
      for (int k = 0; k < 40; ++k) {
        Vec3 point = point_at_an_end(corners, boxes[i][random() % boxes[i].size()], random);
        for (int axis = 0; axis < 3; ++axis) {
          const float stray = side * 0x1p-11f * (2.0f * uniform(random) - 1.0f);
          point[axis] = std::clamp(point[axis] + stray, whole.lower[axis], whole.upper[axis]);
        }
        EXPECT_TRUE(std::any_of(boxes[i].begin(), boxes[i].end(),
                                [&](const octree::Box& box) { return contains(box, point); }))
            << "triangle " << i;
      }
    }
  }
}

TEST_P(OctreeSubtrees, AreSoundAndTheSameForAnyThreadCount) {
  for (const bool cuts : {false, true}) {
    for (const std::uint32_t leaf : {std::uint32_t{kernels::kMaxLeafTriangles}, 1u}) {
      octree::Octree expected;
      for (const unsigned threads : kThreads) {
        octree::Octree octree = build(mesh, cuts, threads, leaf);
        if (!cuts) {
          EXPECT_EQ(octree.triangles.size(), mesh.triangles.size());
        }
        if (mesh.name == "room") {
          EXPECT_EQ(octree.cut, cuts);
        }
        if (threads == 1) {
          const util::Result<void> ok = octree::verify(octree, mesh.input());
          ASSERT_TRUE(ok) << mesh.name << ": " << ok.error().to_string();
          expected = std::move(octree);
          continue;
        }
        EXPECT_TRUE(same_bytes(octree.nodes, expected.nodes)) << threads << " threads";
        EXPECT_TRUE(same_bytes(octree.triangles, expected.triangles)) << threads << " threads";
      }
    }
  }
}

TEST_P(OctreeSubtrees, HitWhatBruteForceHits) {
  const octree::Octree octrees[] = {build(mesh, false), build(mesh, true)};
  expect_brute_force(mesh, octrees, scaled(500));
}

// A ray is dimmed once by a BLEND triangle, so it must lie in one leaf.
TEST(OctreeOfBlendedTriangles, HasNoCuts) {
  Mesh mesh;
  for (const LargeMesh& large : large_meshes()) {
    if (large.name == "room") mesh = large.make();
  }
  const std::vector<std::uint32_t> geometry(mesh.triangles.size(), 0);
  const std::uint32_t flags[] = {kernels::kBlend};
  octree::BuildInput input = mesh.input();
  input.triangle_geometry = geometry;
  input.flags = flags;
  octree::Octree octree;
  octree::build_sah(input, {}, octree);
  EXPECT_EQ(octree.triangles.size(), mesh.triangles.size());
  EXPECT_FALSE(octree.cut);
  EXPECT_TRUE(octree::verify(octree, input));
}

// Ever smaller triangles in a row, of which an eight-way node takes no more than two. Down to
// surfaces that vanish the tree would be too deep, and halves by rank are left, whose leaves end at
// the eleventh level.
TEST(OctreeOfAChain, IsOfHalvesByRankWhereItWouldBeTooDeep) {
  constexpr std::uint32_t kCount = 6000;
  for (const int least : {-20, -71}) {
    const Mesh mesh = make_mesh("chain", kCount, [&](std::uint32_t i, int c, std::mt19937_64&) {
      const double steps = 62.0 - least;
      const auto s = static_cast<float>(std::exp2(61.8 - steps * i / kCount));
      return Vec3(c == 1 ? 1.001f * s : s, c == 2 ? 0.001f * s : 0.0f, c == 1 ? 0.001f * s : 0.0f);
    });
    const octree::Octree octree = build(mesh, true);
    const util::Result<void> ok = octree::verify(octree, mesh.input());
    EXPECT_TRUE(ok) << ok.error().to_string();
    // Halves of 6000 triangles by rank are eleven nodes deep.
    const std::uint32_t depth = octree::statistics(octree).depth;
    if (least == -71) {
      EXPECT_EQ(depth, 11u);
    } else {
      EXPECT_GT(depth, 11u);
      EXPECT_LE(depth, 20u);
    }
  }
}

// Where re-insertion would make a subtree too deep, that subtree alone is left as it was split.
TEST(OctreeOfADiscInDust, IsNoWorseThanWithoutReinsertion) {
  for (const std::uint32_t sectors : {1024u, 4096u, 8192u}) {
    const Mesh mesh = make_disc_in_dust(sectors);
    const octree::BuildInput input = mesh.input();
    octree::TopOptions options;
    options.reinsert_rounds = 0;
    octree::Octree plain;
    plain.triangles.reserve(2 * mesh.triangles.size());
    plain.triangles.resize(mesh.triangles.size());
    auto* const references = reinterpret_cast<octree::LooseReference*>(plain.triangles.data());
    const octree::TopTree top = octree::split_top(input, options, references);
    ASSERT_TRUE(
        octree::build_subtrees(top, options, kernels::kMaxLeafTriangles, input, references, plain));
    const octree::Octree octree = build(mesh, true);
    const util::Result<void> ok = octree::verify(octree, input);
    EXPECT_TRUE(ok) << ok.error().to_string();
    EXPECT_LE(octree::statistics(octree).sah_cost, 1.02 * octree::statistics(plain).sah_cost)
        << sectors << " sectors";
    EXPECT_LE(octree::statistics(octree).depth, octree::statistics(plain).depth + 6) << sectors;
    // Other subtrees are not.
    EXPECT_FALSE(same_bytes(octree.nodes, plain.nodes)) << sectors;
  }
}

// Beyond what scenes may hold: surfaces and costs that are infinite.
TEST(OctreeOfHugeTriangles, IsSound) {
  for (const float scale : {1e18f, 1e19f, 1e38f}) {
    for (const std::uint32_t count : {5u, 30u, 20000u}) {
      const Mesh mesh = make_dust(count, scale);
      for (const bool cuts : {false, true}) {
        const util::Result<void> ok = octree::verify(build(mesh, cuts), mesh.input());
        EXPECT_TRUE(ok) << scale << ", " << count << ": " << ok.error().to_string();
      }
      for (const octree::Builder builder : {octree::Builder::sah, octree::Builder::quality}) {
        octree::BuildOptions options;
        options.builder = builder;
        const util::Result<octree::Octree> octree = octree::build(mesh.input(), options);
        ASSERT_TRUE(octree);
        const util::Result<void> ok = octree::verify(*octree, mesh.input());
        EXPECT_TRUE(ok) << scale << ", " << count << ": " << ok.error().to_string();
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, OctreeSubtrees,
                         testing::Range<std::size_t>(0, large_meshes().size()),
                         [](const auto& about) { return large_meshes()[about.param].name; });

}  // namespace
}  // namespace octrace::tests
