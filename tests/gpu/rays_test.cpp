// Random rays on hard meshes: triangle, t, u and v of the GPU have the bits of the CPU.
// 10^7 rays by default; OCTRACE_TEST_INTENSITY=10 makes it 10^8.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <atomic>
#include <cstring>

#include "backend/render/device_memory.h"
#include "kernels/cpu/intersect.h"
#include "tests/gpu/devices.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Hit;
using kernels::Ray;
namespace cuda = kernels::cuda;

constexpr std::uint64_t kBatch = 1'000'000;

std::vector<Ray> make_rays(const Mesh& mesh, const octree::Octree& octree, std::uint64_t batch) {
  std::vector<Ray> rays(kBatch);
  constexpr std::uint64_t kChunk = 10'000;
  tbb::parallel_for(std::uint64_t{0}, kBatch / kChunk, [&](std::uint64_t chunk) {
    std::mt19937_64 random(seed() + batch * 7919 + chunk);
    for (std::uint64_t i = chunk * kChunk; i < (chunk + 1) * kChunk; ++i) {
      rays[i] = random_ray(mesh, octree, random);
    }
  });
  return rays;
}

class GpuRays {
 public:
  explicit GpuRays(const octree::Octree& octree) {
    const std::uint64_t node_bytes = octree.nodes.size() * sizeof(kernels::Node);
    const std::uint64_t triangle_bytes = octree.triangles.size() * sizeof(kernels::LeafTriangle);
    check(nodes_.reserve(node_bytes));
    check(triangles_.reserve(triangle_bytes));
    check(rays_.reserve(kBatch * sizeof(Ray)));
    check(hits_.reserve(kBatch * sizeof(Hit)));
    check(report_.reserve(sizeof(cuda::Report)));
    check(cuda::copy_to_device(nodes_.data(), octree.nodes.data(), node_bytes, nullptr));
    check(
        cuda::copy_to_device(triangles_.data(), octree.triangles.data(), triangle_bytes, nullptr));
    view_ = {
        {static_cast<const kernels::Node*>(nodes_.data()), octree.nodes.size()},
        {static_cast<const kernels::LeafTriangle*>(triangles_.data()), octree.triangles.size()}};
  }

  // cut: which of the two walks, whatever the tree.
  std::vector<Hit> trace(const std::vector<Ray>& rays, bool any_hit, bool cut = false) {
    view_.cut = cut;
    std::vector<Hit> hits(rays.size());
    cuda::Report report{};
    check(cuda::clear(report_.data(), sizeof report, nullptr));
    check(cuda::copy_to_device(rays_.data(), rays.data(), rays.size() * sizeof(Ray), nullptr));
    check(cuda::launch_rays(view_, {}, static_cast<const Ray*>(rays_.data()),
                            static_cast<Hit*>(hits_.data()), rays.size(), any_hit,
                            static_cast<cuda::Report*>(report_.data()), nullptr));
    check(cuda::copy_to_host(hits.data(), hits_.data(), hits.size() * sizeof(Hit), nullptr));
    check(cuda::copy_to_host(&report, report_.data(), sizeof report, nullptr));
    check(cuda::synchronize(nullptr));
    EXPECT_EQ(0u, report.status) << "ray " << report.x;
    return hits;
  }

 private:
  static void check(const cuda::Status& status) {
    ASSERT_TRUE(status.ok()) << status.call << ": " << status.text;
  }
  render::DeviceMemory nodes_, triangles_, rays_, hits_, report_;
  kernels::OctreeView view_;
};

struct GpuRaysTest : testing::TestWithParam<std::size_t> {};

void compare_with_cpu(const Mesh& mesh, octree::Builder builder) {
  octree::BuildOptions options;
  options.builder = builder;
  const octree::Octree octree = std::move(*octree::build(mesh.input(), options));
  GpuRays gpu(octree);
  kernels::SceneView view;
  view.octree = octree.view();
  const kernels::CpuTracer tracer;
  std::atomic<std::uint64_t> differing{0}, hit_count{0};
  for (std::uint64_t batch = 0; batch < std::max<std::uint64_t>(1, scaled(kBatch) / kBatch);
       ++batch) {
    const std::vector<Ray> rays = make_rays(mesh, octree, batch);
    const std::vector<Hit> closest = gpu.trace(rays, false), any = gpu.trace(rays, true);
    const std::vector<Hit> ordered = gpu.trace(rays, false, true);
    tbb::parallel_for(std::size_t{0}, rays.size(), [&](std::size_t i) {
      Hit hit;
      tracer.closest(view, {}, rays[i], &hit);
      hit_count += hit.valid();
      differing += std::memcmp(&hit, &closest[i], sizeof hit) != 0 ||
                   std::memcmp(&hit, &ordered[i], sizeof hit) != 0 || hit.valid() != any[i].valid();
    });
  }
  EXPECT_EQ(0u, differing) << mesh.name;
  EXPECT_GT(hit_count, 0u);
}

TEST_P(GpuRaysTest, HitWhatTheCpuHits) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  const Mesh mesh = hard_meshes()[GetParam()];
  for (const auto builder : {octree::Builder::sah, octree::Builder::quality}) {
    SCOPED_TRACE(octree::name_of(builder));
    compare_with_cpu(mesh, builder);
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, GpuRaysTest, testing::Range<std::size_t>(0, hard_meshes().size()));

}  // namespace
}  // namespace octrace::tests
