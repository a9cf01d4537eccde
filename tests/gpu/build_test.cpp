// The octree that the GPU builds: every invariant holds, and rays hit in it what they hit in the
// CPU's octree, bit for bit.
#include <gtest/gtest.h>

#include <cstring>

#include "backend/render/device_builder.h"
#include "kernels/cpu/intersect.h"
#include "tests/gpu/devices.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

kernels::SceneView view_of(const octree::Octree& octree) {
  kernels::SceneView view;
  view.octree = octree.view();
  return view;
}

void expect_same_hits(const Mesh& mesh, const octree::Octree& expected,
                      const octree::Octree& built) {
  const kernels::CpuTracer tracer;
  std::mt19937_64 random(seed());
  std::uint64_t differing = 0;
  const std::uint64_t count = scaled(100'000);
  for (std::uint64_t i = 0; i < count; ++i) {
    const kernels::Ray ray = random_ray(mesh, built, random);
    kernels::Hit a, b;
    tracer.closest(view_of(expected), {}, ray, &a);
    tracer.closest(view_of(built), {}, ray, &b);
    differing += std::memcmp(&a, &b, sizeof a) != 0;
  }
  EXPECT_EQ(0u, differing) << mesh.name << ", seed " << seed();
}

void expect_sound(const Mesh& mesh) {
  util::Result<octree::Octree> built = render::build_on_device(mesh.input(), 0);
  ASSERT_TRUE(built) << mesh.name << ": " << built.error().message;
  const util::Result<void> verified = octree::verify(*built, mesh.input());
  ASSERT_TRUE(verified) << mesh.name << ": " << verified.error().message;
  expect_same_hits(mesh, *octree::build(mesh.input(), {}), *built);
}

struct GpuBuildTest : testing::TestWithParam<std::size_t> {};

TEST_P(GpuBuildTest, IsSound) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  expect_sound(hard_meshes()[GetParam()]);
}

INSTANTIATE_TEST_SUITE_P(Meshes, GpuBuildTest,
                         testing::Range<std::size_t>(0, hard_meshes().size()));

// Around every size at which a stage changes what it does: one leaf, one node, one warp, one merge.
TEST(GpuBuildTest, IsSoundAtEverySmallSize) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  const Mesh sphere = make_sphere(12, {0.0f, 0.0f, 0.0f}, 1.0f);
  for (std::size_t triangles = 1; triangles <= 70; ++triangles) {
    Mesh mesh = sphere;
    mesh.triangles.resize(triangles);
    util::Result<octree::Octree> built = render::build_on_device(mesh.input(), 0);
    ASSERT_TRUE(built) << built.error().message;
    const util::Result<void> verified = octree::verify(*built, mesh.input());
    ASSERT_TRUE(verified) << triangles << ": " << verified.error().message;
  }
}

TEST(GpuBuildTest, IsTheSameTreeEveryTime) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  const Mesh mesh = make_sphere(200, {0.0f, 0.0f, 0.0f}, 1.0f);
  const octree::Statistics first = octree::statistics(*render::build_on_device(mesh.input(), 0));
  for (int i = 0; i < 5; ++i) {
    const octree::Statistics again = octree::statistics(*render::build_on_device(mesh.input(), 0));
    EXPECT_EQ(first.nodes, again.nodes);
    EXPECT_EQ(first.leaves, again.leaves);
    EXPECT_EQ(first.depth, again.depth);
  }
}

TEST(GpuBuildTest, OfNothingIsEmpty) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  const util::Result<octree::Octree> built = render::build_on_device({}, 0);
  ASSERT_TRUE(built);
  EXPECT_TRUE(built->nodes.empty());
}

}  // namespace
}  // namespace octrace::tests
