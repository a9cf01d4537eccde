// Scenes of several subtrees (backend/octree/top_tree.h): the ranges that threads take, and the
// octrees made of them by either way, whole or in parts. The other tests' meshes are smaller than
// one subtree.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "backend/octree/builders.h"
#include "backend/octree/top_tree.h"
#include "kernels/cpu/intersect.h"
#include "tests/support/brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Vec3;

constexpr unsigned kThreads[] = {1, 2, 3, 8};
// Triangles from which subtrees are built one by one: always; never.
constexpr std::uint32_t kWays[] = {0, std::numeric_limits<std::uint32_t>::max()};

using Corner = std::function<Vec3(std::uint32_t triangle, int corner, std::mt19937_64&)>;

Mesh make(const char* name, std::uint32_t count, const Corner& corner) {
  Mesh mesh{name, {}, {}};
  std::mt19937_64 random(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int c = 0; c < 3; ++c) mesh.positions.push_back(corner(i, c, random));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

float uniform(std::mt19937_64& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

Mesh make_dust(std::uint32_t count, float scale = 1.0f) {
  Vec3 centre;
  return make("dust", count, [&](std::uint32_t, int c, std::mt19937_64& random) {
    const Vec3 v(uniform(random), uniform(random), uniform(random));
    if (c == 0) centre = v;
    return scale * (centre + 0.01f * v);
  });
}

// Made when it is asked for: every process of these tests goes through all names.
struct LargeMesh {
  std::string name;
  std::function<Mesh()> make;
};

// From 5462 triangles on a scene has more than one range, of up to 8192 references; at 43696 the
// ranges become smaller (subtree_size() in top_tree.cpp).
std::vector<LargeMesh> large_meshes() {
  std::vector<LargeMesh> meshes;
  for (const std::uint32_t count :
       {5460u, 5461u, 5462u, 8191u, 8192u, 8193u, 43690u, 43695u, 43696u, 100000u}) {
    meshes.push_back({"dust_" + std::to_string(count), [count] { return make_dust(count); }});
  }
  const auto add = [&](const char* name, std::uint32_t count, const Corner& corner) {
    meshes.push_back({name, [=] { return make(name, count, corner); }});
  };
  add("one_place", 8193,
      [](std::uint32_t, int c, std::mt19937_64&) { return Vec3(c == 0, c == 1, c == 2); });
  add("one_point", 20000,
      [](std::uint32_t, int, std::mt19937_64&) { return Vec3(3.0f, -2.0f, 1.0f); });
  add("long_slivers", 20000, [](std::uint32_t i, int c, std::mt19937_64& random) {
    const float y = static_cast<float>(i) * 1e-4f;
    return c == 0   ? Vec3(-100.0f, y, 0.0f)
           : c == 1 ? Vec3(100.0f, y, uniform(random))
                    : Vec3(100.0f, y + 1e-6f, 0.0f);
  });
  add("one_huge_among_many", 20000, [](std::uint32_t i, int c, std::mt19937_64& r) {
    if (i == 7777) return Vec3(c == 0 ? 1e4f : -1.0f, c == 1 ? 1e4f : -1.0f, c == 2 ? 1e4f : -1.0f);
    return Vec3(uniform(r), uniform(r), uniform(r)) * 0.01f + Vec3(static_cast<float>(i % 141));
  });
  meshes.push_back({"denormals", [] { return make_dust(20000, 1e-42f); }});
  meshes.push_back({"far", [] { return make_dust(20000, 9e8f); }});
  // Ever smaller triangles about one corner: the deepest trees, from which halving by rank saves.
  add("chain", 20000, [](std::uint32_t i, int c, std::mt19937_64&) {
    const float s = std::exp2(-0.007f * static_cast<float>(i));
    return Vec3(c == 0 ? s : 0.0f, c == 1 ? s : 0.0f, c == 2 ? s : 0.0f);
  });
  return meshes;
}

template <class T, class Allocator>
bool same_bytes(const std::vector<T, Allocator>& a, const std::vector<T, Allocator>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

octree::Octree build(const Mesh& mesh, std::uint32_t least_for_subtrees, unsigned threads = 1,
                     std::uint32_t leaf = kernels::kMaxLeafTriangles) {
  const octree::BuildInput input = mesh.input();
  octree::Octree octree;
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    octree::build_sah(input, leaf, false, octree, least_for_subtrees);
  });
  return octree;
}

struct OctreeSubtrees : testing::TestWithParam<std::size_t> {
  // As many threads as are asked for, on machines of fewer cores as well.
  tbb::global_control more{tbb::global_control::max_allowed_parallelism, 8};
  Mesh mesh = large_meshes()[GetParam()].make();
};

TEST_P(OctreeSubtrees, RangesHoldAllReferences) {
  const octree::BuildInput input = mesh.input();
  const std::size_t count = input.triangles.size();
  for (const int sah_depth : {64, 3, 0}) {
    octree::TopOptions options;
    options.sah_depth = sah_depth;
    std::vector<std::uint32_t> expected;
    for (const unsigned threads : kThreads) {
      std::vector<octree::LooseReference> references(count);
      octree::TopTree top;
      tbb::task_arena(static_cast<int>(threads)).execute([&] {
        top = octree::split_top(input, options, references.data());
      });
      EXPECT_EQ(top.subtrees.size() > 1, count > 5461);
      std::uint32_t next = 0;
      std::vector<std::uint32_t> triangles;
      for (const octree::TopRange* range : top.subtrees) {
        ASSERT_EQ(range->first, next);
        ASSERT_GT(range->count, 0u);
        ASSERT_LE(range->count, octree::kMostInSubtree);
        next += range->count;
        octree::Box bounds;
        for (std::uint32_t i = range->first; i < next; ++i) {
          const octree::LooseReference& reference = references[i];
          triangles.push_back(reference.triangle);
          ASSERT_LT(reference.triangle, count);
          ASSERT_EQ(reference.corners.a, input.triangles[reference.triangle].a);
          bounds.add(octree::triangle_box(input, reference.triangle));
        }
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(range->bounds.lower(axis), bounds.lower[axis]);
          EXPECT_EQ(range->bounds.upper(axis), bounds.upper[axis]);
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

TEST_P(OctreeSubtrees, AreSoundAndTheSameForAnyThreadCount) {
  for (const std::uint32_t way : kWays) {
    for (const std::uint32_t leaf : {std::uint32_t{kernels::kMaxLeafTriangles}, 1u}) {
      octree::Octree expected;
      for (const unsigned threads : kThreads) {
        octree::Octree octree = build(mesh, way, threads, leaf);
        EXPECT_EQ(octree.triangles.size(), mesh.triangles.size());
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
  const octree::Octree octrees[] = {build(mesh, kWays[0]), build(mesh, kWays[1])};
  const kernels::CpuTracer tracer;
  std::mt19937_64 random(seed());
  for (std::uint64_t i = 0; i < scaled(500); ++i) {
    const kernels::Ray ray = random_ray(mesh, octrees[i % 2], random);
    const kernels::Hit expected = brute_force(mesh.positions, mesh.triangles, ray);
    for (const octree::Octree& octree : octrees) {
      kernels::SceneView view;
      view.octree = octree.view();
      kernels::Hit found;
      ASSERT_EQ(kernels::TraceStatus::ok, tracer.closest(view, {}, ray, &found));
      ASSERT_EQ(found.triangle, expected.triangle)
          << mesh.name << ", seed " << seed() << ", ray " << i;
      if (expected.valid()) {
        ASSERT_EQ(0, std::memcmp(&found.t, &expected.t, sizeof(float)));
      }
    }
  }
}

TEST(OctreeOfDust, IsBuiltInPartsWhereItIsLarge) {
  for (const std::uint32_t count : {octree::kLeastForSubtrees - 1, octree::kLeastForSubtrees}) {
    const Mesh mesh = make_dust(count);
    const util::Result<octree::Octree> octree = octree::build(mesh.input(), {});
    ASSERT_TRUE(octree);
    const bool large = count == octree::kLeastForSubtrees;
    EXPECT_TRUE(same_bytes(octree->nodes, build(mesh, kWays[large ? 0 : 1]).nodes));
    EXPECT_FALSE(same_bytes(octree->nodes, build(mesh, kWays[large ? 1 : 0]).nodes));
  }
}

// Ever smaller triangles in a row, down to surfaces that vanish, of which an eight-way node takes
// no more than two. Down to 2^-70 the way in parts is too deep and the whole tree is not; down to
// 2^-71 both are, and halves by rank are left.
TEST(OctreeOfAChain, FallsBackToTheWholeTreeAndThenToHalvesByRank) {
  constexpr std::uint32_t kCount = 6000;
  for (const int least : {-70, -71}) {
    const Mesh mesh = make("chain", kCount, [&](std::uint32_t i, int c, std::mt19937_64&) {
      const double steps = 62.0 - least;
      const auto s = static_cast<float>(std::exp2(61.8 - steps * i / kCount));
      return Vec3(c == 1 ? 1.001f * s : s, c == 2 ? 0.001f * s : 0.0f, c == 1 ? 0.001f * s : 0.0f);
    });
    const octree::Octree parts = build(mesh, kWays[0]), whole = build(mesh, kWays[1]);
    const util::Result<void> ok = octree::verify(parts, mesh.input());
    EXPECT_TRUE(ok) << ok.error().to_string();
    EXPECT_TRUE(same_bytes(parts.nodes, whole.nodes));
    EXPECT_TRUE(same_bytes(parts.triangles, whole.triangles));
    // Halves of 6000 by rank end in leaves at the eleventh level.
    EXPECT_EQ(octree::statistics(parts).depth, least == -70 ? 10u : 11u);
  }
}

// Beyond what scenes may hold: surfaces and costs that are infinite.
TEST(OctreeOfHugeTriangles, IsSound) {
  for (const float scale : {1e18f, 1e19f, 1e38f}) {
    for (const std::uint32_t count : {5u, 30u, 20000u}) {
      const Mesh mesh = make_dust(count, scale);
      for (const std::uint32_t way : kWays) {
        const util::Result<void> ok = octree::verify(build(mesh, way), mesh.input());
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
