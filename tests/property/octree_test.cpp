// The octree against brute force: the same triangle, t, u and v, bit for bit, for every builder.
#include "backend/octree/octree.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>

#include "kernels/cpu/intersect.h"
#include "tests/support/brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Hit;
using kernels::Ray;
using octree::Builder;

bool same_bits(const Hit& a, const Hit& b) {
  return a.triangle == b.triangle &&
         (!a.valid() || (std::bit_cast<std::uint32_t>(a.t) == std::bit_cast<std::uint32_t>(b.t) &&
                         std::bit_cast<std::uint32_t>(a.u) == std::bit_cast<std::uint32_t>(b.u) &&
                         std::bit_cast<std::uint32_t>(a.v) == std::bit_cast<std::uint32_t>(b.v)));
}

std::string describe(const Mesh& mesh, const Ray& ray, const Hit& expected, const Hit& found) {
  char text[512];
  std::snprintf(
      text, sizeof text,
      "%s: ray o=(%a %a %a) d=(%a %a %a) t=[%a %a]: brute force %u t=%a u=%a v=%a, octree "
      "%u t=%a u=%a v=%a",
      mesh.name.c_str(), ray.origin.x, ray.origin.y, ray.origin.z, ray.direction.x, ray.direction.y,
      ray.direction.z, ray.tmin, ray.tmax, expected.triangle, expected.t, expected.u, expected.v,
      found.triangle, found.t, found.u, found.v);
  return text;
}

struct OctreeProperty : testing::TestWithParam<std::size_t> {
  Mesh mesh = hard_meshes()[GetParam()];

  octree::Octree build(Builder builder, std::uint32_t leaf = 0, unsigned threads = 0) const {
    octree::BuildOptions options;
    options.builder = builder;
    options.leaf = leaf;
    options.threads = threads;
    util::Result<octree::Octree> octree = octree::build(mesh.input(), options);
    EXPECT_TRUE(octree);
    return std::move(*octree);
  }
};

TEST_P(OctreeProperty, KeepsItsInvariants) {
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    for (const std::uint32_t leaf : {0u, 1u, 2u, 64u}) {
      const octree::Octree octree = build(builder, leaf);
      const util::Result<void> ok = octree::verify(octree, mesh.input());
      EXPECT_TRUE(ok) << mesh.name << ": " << (ok ? "" : ok.error().to_string());
    }
  }
}

TEST_P(OctreeProperty, IsTheSameTreeForAnyThreadCount) {
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    const octree::Octree one = build(builder, 0, 1);
    const octree::Octree two = build(builder, 0, 2);
    ASSERT_EQ(one.nodes.size(), two.nodes.size());
    EXPECT_EQ(0, std::memcmp(one.nodes.data(), two.nodes.data(),
                             one.nodes.size() * sizeof(kernels::Node)));
    EXPECT_EQ(0, std::memcmp(one.triangles.data(), two.triangles.data(),
                             one.triangles.size() * sizeof(kernels::LeafTriangle)));
  }
}

// 10^6 rays a mesh, a third of them for each builder.
TEST_P(OctreeProperty, HitsWhatBruteForceHits) {
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    const octree::Octree octree = build(builder);
    kernels::SceneView view;
    view.octree = octree.view();
    const kernels::CpuTracer tracer;
    const kernels::RenderParams params;
    std::atomic<std::uint64_t> hits{0}, failures{0};
    constexpr std::uint64_t kBatch = 5000;
    tbb::parallel_for(std::uint64_t{0}, scaled(333'000) / kBatch + 1, [&](std::uint64_t batch) {
      std::mt19937_64 random(seed() + batch * 977 + static_cast<std::uint64_t>(builder));
      for (std::uint64_t i = 0; i < kBatch && failures < 3; ++i) {
        const Ray ray = random_ray(mesh, octree, random);
        const Hit expected = brute_force(mesh.positions, mesh.triangles, ray);
        Hit found, scalar;
        EXPECT_EQ(kernels::TraceStatus::ok, tracer.closest(view, params, ray, &found));
        EXPECT_EQ(kernels::TraceStatus::ok,
                  kernels::closest_hit(view, params, ray, kernels::ScalarChildTest{}, &scalar));
        hits += expected.valid();
        if (!same_bits(expected, found) || !same_bits(expected, scalar)) {
          ++failures;
          ADD_FAILURE() << "seed " << seed() << ", " << describe(mesh, ray, expected, found);
        }
        float transmittance = -1.0f;
        EXPECT_EQ(kernels::TraceStatus::ok,
                  tracer.transmittance(view, params, ray, &transmittance));
        EXPECT_EQ(expected.valid() ? 0.0f : 1.0f, transmittance)
            << describe(mesh, ray, expected, found);
      }
    });
    EXPECT_GT(hits, scaled(333'000) / 10) << mesh.name;
  }
}

std::string mesh_name(const testing::TestParamInfo<std::size_t>& info) {
  std::string name = hard_meshes()[info.param].name;
  for (char& c : name) {
    if (c == ' ') c = '_';
  }
  return name;
}
INSTANTIATE_TEST_SUITE_P(Meshes, OctreeProperty,
                         testing::Range<std::size_t>(0, hard_meshes().size()), mesh_name);

// A closed surface leaves no gap: rays from inside always hit, also through edges and corners.
TEST(Watertight, RaysFromInsideASphereAlwaysHit) {
  for (const kernels::Vec3 centre : {kernels::Vec3(0.0f), kernels::Vec3(1e4f, -1e3f, 77.0f)}) {
    const Mesh mesh = make_sphere(24, centre, 3.0f);
    util::Result<octree::Octree> octree = octree::build(mesh.input(), {});
    ASSERT_TRUE(octree);
    kernels::SceneView view;
    view.octree = octree->view();
    const kernels::CpuTracer tracer;
    std::mt19937_64 random(seed());
    std::uint64_t missed = 0;
    for (std::uint64_t i = 0; i < scaled(1'000'000); ++i) {
      const kernels::Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
      const kernels::Vec3 a = mesh.positions[t.a], b = mesh.positions[t.b];
      const float s = static_cast<float>(random() % 5) * 0.25f;
      const Ray ray{centre, 0.0f, a + s * (b - a) - centre, std::numeric_limits<float>::infinity()};
      Hit hit;
      ASSERT_EQ(kernels::TraceStatus::ok, tracer.closest(view, {}, ray, &hit));
      missed += !hit.valid();
    }
    EXPECT_EQ(0u, missed);
  }
}

// Long thin triangles across each other: no split of centres parts them.
Mesh make_sticks(std::uint32_t count) {
  Mesh mesh{"sticks", {}, {}};
  std::mt19937_64 random(seed());
  std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
  const auto point = [&] { return kernels::Vec3(unit(random), unit(random), unit(random)); };
  for (std::uint32_t i = 0; i < count; ++i) {
    const kernels::Vec3 a = point(), b = point();
    mesh.positions.insert(mesh.positions.end(), {a, b, b + 0.01f * point()});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

TEST(Octree, ListsTrianglesInSeveralLeavesExceptBlendOnes) {
  const Mesh mesh = make_sticks(400);
  const std::vector<std::uint32_t> geometry(mesh.triangles.size(), 0);
  for (const Builder builder : {Builder::sah, Builder::quality}) {
    for (const std::uint32_t flags : {0u, kernels::kBlend}) {
      octree::BuildOptions options;
      options.builder = builder;
      const octree::BuildInput input{mesh.positions, mesh.triangles, geometry, {&flags, 1}};
      const util::Result<octree::Octree> octree = octree::build(input, options);
      ASSERT_TRUE(octree);
      EXPECT_TRUE(octree::verify(*octree, input));
      EXPECT_EQ(octree->triangles.size() > mesh.triangles.size() * 1.01, octree->cut);
      if (flags == 0) {
        if (builder == Builder::quality) {
          EXPECT_GT(octree->triangles.size(), mesh.triangles.size());
        }
        const double most = builder == Builder::quality ? 1.5 : 1.1;
        EXPECT_LE(static_cast<double>(octree->triangles.size()),
                  most * static_cast<double>(mesh.triangles.size()));
      } else {
        EXPECT_EQ(mesh.triangles.size(), octree->triangles.size());
      }
    }
  }
}

// Chains of ever smaller triangles make the deepest trees.
TEST(Octree, StaysWithinItsDepth) {
  Mesh mesh{"chain", {}, {}};
  for (int i = 0; i < 3000; ++i) {
    const float s = std::exp2(-0.03f * static_cast<float>(i));
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {{s, 0, 0}, {0, s, 0}, {0, 0, s}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    octree::BuildOptions options;
    options.builder = builder;
    const util::Result<octree::Octree> octree = octree::build(mesh.input(), options);
    ASSERT_TRUE(octree);
    const util::Result<void> ok = octree::verify(*octree, mesh.input());
    EXPECT_TRUE(ok) << (ok ? "" : ok.error().to_string());
  }
}

TEST(Octree, IsEmptyOverNothing) {
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    octree::BuildOptions options;
    options.builder = builder;
    util::Result<octree::Octree> octree = octree::build(octree::BuildInput{}, options);
    ASSERT_TRUE(octree);
    EXPECT_TRUE(octree->nodes.empty());
    EXPECT_TRUE(octree::verify(*octree, octree::BuildInput{}));
    kernels::SceneView view;
    Hit hit;
    EXPECT_EQ(kernels::TraceStatus::ok,
              kernels::CpuTracer().closest(view, {}, Ray{{}, 0.0f, {0, 0, 1}, 1.0f}, &hit));
    EXPECT_FALSE(hit.valid());
  }
}

TEST(Octree, RefusesToPassTheMemoryLimit) {
  const Mesh mesh = make_sphere(20, kernels::Vec3(0.0f), 1.0f);
  octree::BuildOptions options;
  options.max_bytes = 1000;
  const util::Result<octree::Octree> octree = octree::build(mesh.input(), options);
  ASSERT_FALSE(octree);
  EXPECT_EQ(util::Exit::limit, octree.error().exit);
  EXPECT_NE(std::string::npos, octree.error().message.find("--max-scene-bytes"));
}

// verify() is worth something only if it sees each kind of damage.
TEST(Verify, FindsPlantedDamage) {
  const Mesh mesh = make_sphere(20, kernels::Vec3(0.0f), 1.0f);
  const octree::Octree good = std::move(*octree::build(mesh.input(), {}));
  ASSERT_TRUE(octree::verify(good, mesh.input()));
  const auto damaged = [&](auto&& damage) {
    octree::Octree octree = good;
    damage(octree);
    const util::Result<void> result = octree::verify(octree, mesh.input());
    return !result && result.error().exit == util::Exit::internal;
  };
  const int slot = std::countr_zero(static_cast<unsigned>(good.nodes[0].inner_mask));
  EXPECT_TRUE(damaged([&](auto& o) { o.nodes[0].upper[1][slot] -= 1; })) << "box too small";
  EXPECT_TRUE(damaged([&](auto& o) { o.nodes[0].lower[2][slot] += 1; })) << "box too small";
  EXPECT_TRUE(damaged([&](auto& o) { o.nodes[0].first_child = 0; })) << "cycle";
  EXPECT_TRUE(damaged([&](auto& o) { o.nodes[0].first_child = 1u << 30; })) << "out of range";
  EXPECT_TRUE(damaged([&](auto& o) { o.triangles[5].triangle = o.triangles[6].triangle; }))
      << "twice";
  EXPECT_TRUE(damaged([&](auto& o) { o.triangles[5].a.x += 1e-3f; })) << "wrong corner";
  EXPECT_TRUE(damaged([&](auto& o) { o.triangles.pop_back(); })) << "missing triangle";
  EXPECT_TRUE(damaged([&](auto& o) { o.triangles.push_back(o.triangles[0]); })) << "in no leaf";
  EXPECT_TRUE(damaged([&](auto& o) { o.nodes.back().meta[7] ^= 0x20; })) << "leaf counts";
}

// A triangle in several leaves must be all in their boxes.
TEST(Verify, FindsPartsThatAreMissing) {
  const Mesh mesh = make_sticks(400);
  octree::BuildOptions options;
  options.builder = Builder::quality;
  const octree::Octree good = std::move(*octree::build(mesh.input(), options));
  ASSERT_TRUE(octree::verify(good, mesh.input()));
  std::vector<int> leaves(mesh.triangles.size(), 0);
  for (const kernels::LeafTriangle& leaf : good.triangles) ++leaves[leaf.triangle];
  std::uint64_t damaged = 0;
  for (std::size_t i = 0; i < good.triangles.size(); ++i) {
    if (leaves[good.triangles[i].triangle] < 2) continue;
    // Another triangle that is in several leaves takes the place of a part of this one.
    for (std::size_t j = 0; j < good.triangles.size(); ++j) {
      if (leaves[good.triangles[j].triangle] < 2 ||
          good.triangles[j].triangle == good.triangles[i].triangle)
        continue;
      octree::Octree octree = good;
      octree.triangles[i] = good.triangles[j];
      EXPECT_FALSE(octree::verify(octree, mesh.input())) << i << " " << j;
      ++damaged;
      break;
    }
  }
  EXPECT_GT(damaged, 10u);
}

// A cycle in the nodes ends in a status, not in a hang.
TEST(Traverse, StopsAtACycle) {
  const Mesh mesh = make_sphere(20, kernels::Vec3(0.0f), 1.0f);
  octree::Octree octree = std::move(*octree::build(mesh.input(), {}));
  for (kernels::Node& node : octree.nodes) node.first_child = 0;
  kernels::SceneView view;
  view.octree = octree.view();
  // Which of them meet a child that is its own ancestor depends on the tree.
  int stopped = 0;
  for (int i = 0; i < 64; ++i) {
    const float y = 0.25f * static_cast<float>(i % 8) - 0.87f;
    const float z = 0.25f * static_cast<float>(i / 8) - 0.88f;
    const Ray ray{{-3.0f, y, z}, 0.0f, {1.0f, 0.0f, 0.0f}, 10.0f};
    Hit hit;
    stopped += kernels::CpuTracer().closest(view, {}, ray, &hit) != kernels::TraceStatus::ok;
  }
  EXPECT_GT(stopped, 0);
}

}  // namespace
}  // namespace octrace::tests
