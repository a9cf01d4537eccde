// With the device's memory taken by somebody else, an image needs more launches, then the CPU; it
// is the same image.
#include <gtest/gtest.h>

#include "backend/render/cuda_renderer.h"
#include "tests/gpu/devices.h"
#include "tests/gpu/load.h"

namespace octrace::tests {
namespace {

using render::Aov;

// Takes device memory until less than `leave` bytes are free.
std::vector<render::DeviceMemory> take_memory(std::uint64_t leave) {
  std::vector<render::DeviceMemory> taken;
  kernels::cuda::Device device{};
  for (std::uint64_t chunk = 1ull << 33; chunk >= (1u << 20); chunk /= 2) {
    for (;;) {
      EXPECT_TRUE(kernels::cuda::query_device(0, &device).ok());
      if (device.free_bytes < leave + chunk) break;
      render::DeviceMemory memory;
      if (!memory.reserve(chunk).ok()) break;
      taken.push_back(std::move(memory));
    }
  }
  return taken;
}

std::vector<float> depth_of(render::Renderer& renderer, const scene::Scene& scene,
                            std::string* device) {
  render::Framebuffer framebuffer(2048, 2048, render::AovSet().set().reset(0));
  const auto stats = renderer.render(scene::make_ray_camera(first_camera(scene, 1.0), 2048, 2048),
                                     {}, framebuffer);
  EXPECT_TRUE(stats) << (stats ? "" : stats.error().to_string());
  if (stats) *device = stats->device;
  const auto depth = framebuffer.floats(Aov::depth);
  return {depth.begin(), depth.end()};
}

TEST(DeviceMemory, FewerRowsALaunchThenTheCpu) {
  if (const std::string why = render::cuda_unavailable(0); !why.empty()) GTEST_SKIP() << why;
  const auto loaded = load_for_device_test("builtin:paper");
  ASSERT_TRUE(loaded);
  std::string device;
  const auto cpu = render::make_cpu_renderer(loaded->scene, loaded->octree);
  const std::vector<float> expected = depth_of(*cpu, loaded->scene, &device);

  const auto gpu =
      render::make_renderer(loaded->scene, loaded->octree, {render::DeviceKind::cuda, 0});
  {
    const auto taken = take_memory(24u << 20);
    testing::internal::CaptureStderr();
    EXPECT_EQ(expected, depth_of(*gpu, loaded->scene, &device));
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_TRUE(device.starts_with("cuda")) << device;
    EXPECT_NE(std::string::npos, said.find("rows a launch")) << said;
  }
  // Nothing at all: a new renderer cannot even upload the scene.
  const auto taken = take_memory(0);
  testing::internal::CaptureStderr();
  const auto large = load_for_device_test("builtin:soup");
  ASSERT_TRUE(large);
  const auto fallback =
      render::make_renderer(large->scene, large->octree, {render::DeviceKind::cuda, 0});
  depth_of(*fallback, large->scene, &device);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_TRUE(device.starts_with("cpu")) << device;
  EXPECT_NE(std::string::npos, said.find("bytes of device memory")) << said;
}

}  // namespace
}  // namespace octrace::tests
