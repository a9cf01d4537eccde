// One body, every device: closed forms, and bits and colours beside the CPU's.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>

#include "tests/gpu/devices.h"
#include "tests/gpu/load.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using render::Aov;
using render::AovSet;
using render::Framebuffer;

AovSet geometry_aovs() { return AovSet().set().reset(static_cast<std::size_t>(Aov::beauty)); }

Framebuffer render_on(const render::DeviceChoice& device, const LoadedScene& loaded,
                      std::uint32_t width, std::uint32_t height, AovSet aovs,
                      std::uint32_t spp = 1) {
  Framebuffer framebuffer(width, height, aovs);
  const scene::Camera camera = first_camera(loaded.scene, double(width) / height);
  render::Settings settings;
  settings.params.spp = spp;
  const auto renderer = render::make_renderer(loaded.scene, loaded.octree, device);
  const util::Result<render::TraceStats> stats = renderer->render(
      scene::make_ray_camera(camera, static_cast<int>(width), static_cast<int>(height)), settings,
      framebuffer);
  EXPECT_TRUE(stats) << (stats ? "" : stats.error().to_string());
  if (stats) {
    EXPECT_TRUE(stats->device.starts_with(device_name(device))) << stats->device;
  }
  return framebuffer;
}

// The number of values that differ in any bit, over all geometry planes.
std::uint64_t differing_bits(Framebuffer& a, Framebuffer& b) {
  std::uint64_t differing = 0;
  const kernels::FramebufferView va = a.view(), vb = b.view();
  for (const render::AovInfo& info : render::aov_table()) {
    if (info.aov == Aov::beauty || !a.aovs().test(static_cast<std::size_t>(info.aov))) continue;
    const std::uint64_t values = std::uint64_t{a.width()} * a.height() * info.channel_count;
    const std::uint32_t* pa = va.uints(info.aov);
    const std::uint32_t* pb = vb.uints(info.aov);
    for (std::uint64_t i = 0; i < values; ++i) {
      if (pa[i] == pb[i]) continue;
      if (differing == 0) {
        ADD_FAILURE() << info.option << " value " << i << ": " << std::bit_cast<float>(pa[i])
                      << " and " << std::bit_cast<float>(pb[i]);
      }
      ++differing;
    }
  }
  return differing;
}

struct OnDevice : testing::TestWithParam<render::DeviceChoice> {};

// From the second time on a GPU copies to the planes themselves, band by band.
TEST_P(OnDevice, PlanesThatAreFilledAgainAreAsNewOnes) {
  const auto loaded = load_for_device_test("builtin:default");
  ASSERT_TRUE(loaded);
  const auto renderer = render::make_renderer(loaded->scene, loaded->octree, GetParam());
  constexpr std::uint32_t kWidth = 1021, kHeight = 1100;  // two bands
  auto reused = std::make_unique<Framebuffer>(kWidth, kHeight, geometry_aovs());
  scene::Camera camera = first_camera(loaded->scene, double(kWidth) / kHeight);
  for (int view = 0; view < 4; ++view) {
    camera.yfov *= 0.8;
    const kernels::RayCamera rays = scene::make_ray_camera(camera, kWidth, kHeight);
    Framebuffer fresh(kWidth, kHeight, geometry_aovs());
    ASSERT_TRUE(renderer->render(rays, {}, fresh));
    ASSERT_TRUE(renderer->render(rays, {}, *reused));
    EXPECT_EQ(differing_bits(fresh, *reused), 0u) << "view " << view;
  }
  // Memory that others get afterwards is theirs alone.
  reused.reset();
  for (int i = 0; i < 3; ++i) {
    Framebuffer next(kWidth, kHeight, geometry_aovs());
    Framebuffer moved(std::move(next));
    for (int time = 0; time < 3; ++time) {
      ASSERT_TRUE(renderer->render(scene::make_ray_camera(camera, kWidth, kHeight), {}, moved));
    }
  }
}

TEST_P(OnDevice, DepthOfASphereIsItsClosedForm) {
  LoadedScene loaded;
  const Mesh mesh = make_sphere(256, kernels::Vec3(0.0f), 1.0f);
  loaded.scene.positions = mesh.positions;
  loaded.scene.triangles = mesh.triangles;
  loaded.scene.triangle_geometry.assign(mesh.triangles.size(), 0);
  loaded.scene.materials.push_back({});
  loaded.scene.geometries.push_back({0, static_cast<std::uint32_t>(mesh.triangles.size()), 0,
                                     static_cast<std::uint32_t>(mesh.positions.size()), 6, 0,
                                     kernels::kNone, kernels::kNone, kernels::kNone, kernels::kNone,
                                     kernels::kNone});
  scene::Camera camera;
  camera.type = scene::CameraType::orthographic;
  camera.matrix[3] = {0.0, 0.0, 3.0, 1.0};
  loaded.scene.cameras.push_back(camera);
  loaded.scene.materials[0].double_sided = 1;
  loaded.octree = std::move(*octree::build(loaded.scene, {}));
  const Framebuffer image = render_on(GetParam(), loaded, 65, 65, geometry_aovs());
  for (int y = 0; y < 65; ++y) {
    for (int x = 0; x < 65; ++x) {
      const double px = (x + 0.5) / 65 * 2 - 1, py = 1 - (y + 0.5) / 65 * 2, r2 = px * px + py * py;
      const std::size_t i = static_cast<std::size_t>(y) * 65 + x;
      if (r2 > 0.97) continue;  // the polygon's silhouette is not the sphere's
      EXPECT_NEAR(3.0 - std::sqrt(1.0 - r2), image.floats(Aov::depth)[i], 2e-3);
      EXPECT_EQ(7u, image.uints(Aov::object_id)[i]);
      EXPECT_EQ(1.0f, image.floats(Aov::mask)[i]);
    }
  }
}

TEST_P(OnDevice, GeometryHasTheBitsOfTheCpu) {
  for (const char* source : {"builtin:default", "builtin:paper", "builtin:soup:20000"}) {
    const auto loaded = load_for_device_test(source);
    ASSERT_TRUE(loaded);
    Framebuffer expected =
        render_on({render::DeviceKind::cpu, 0}, *loaded, 640, 360, geometry_aovs());
    Framebuffer found = render_on(GetParam(), *loaded, 640, 360, geometry_aovs());
    EXPECT_EQ(0u, differing_bits(expected, found)) << source;
  }
}

TEST_P(OnDevice, InstancesHaveTheBitsOfTheCpu) {
  std::size_t in_view = 0;
  for (const InstanceShape& shape : instance_shapes()) {
    LoadedScene loaded;
    loaded.scene = make_instanced_scene(shape, 300, seed());
    loaded.octree = std::move(*octree::build(loaded.scene, {}));
    Framebuffer expected =
        render_on({render::DeviceKind::cpu, 0}, loaded, 640, 360, geometry_aovs());
    Framebuffer found = render_on(GetParam(), loaded, 640, 360, geometry_aovs());
    EXPECT_EQ(0u, differing_bits(expected, found)) << shape.name;
    const auto ids = found.uints(Aov::object_id);
    in_view += std::any_of(ids.begin(), ids.end(), [](std::uint32_t id) { return id > 3; });
  }
  EXPECT_EQ(in_view, instance_shapes().size());
}

TEST_P(OnDevice, BeautyOfInstancesIsTheCpusWithinRounding) {
  LoadedScene loaded;
  loaded.scene = make_instanced_scene(instance_shapes().front(), 300, seed());
  loaded.octree = std::move(*octree::build(loaded.scene, {}));
  const AovSet beauty = AovSet().set(static_cast<std::size_t>(Aov::beauty));
  const Framebuffer expected = render_on({render::DeviceKind::cpu, 0}, loaded, 320, 180, beauty, 4);
  const Framebuffer found = render_on(GetParam(), loaded, 320, 180, beauty, 4);
  std::size_t differing = 0;
  const auto a = expected.floats(Aov::beauty), b = found.floats(Aov::beauty);
  for (std::size_t i = 0; i < a.size(); ++i) {
    differing += !(std::abs(a[i] - b[i]) <= 1e-4 * std::max(std::abs(a[i]), 1e-3f));
  }
  EXPECT_LE(differing, a.size() / 1000);
}

// Larger than a band, so that bands and their seams are part of it.
TEST_P(OnDevice, BandsMakeOneImage) {
  const auto loaded = load_for_device_test("builtin:paper");
  ASSERT_TRUE(loaded);
  Framebuffer expected =
      render_on({render::DeviceKind::cpu, 0}, *loaded, 2051, 1537, geometry_aovs());
  Framebuffer found = render_on(GetParam(), *loaded, 2051, 1537, geometry_aovs());
  EXPECT_EQ(0u, differing_bits(expected, found));
}

TEST_P(OnDevice, BeautyIsTheCpusWithinRounding) {
  const auto loaded = load_for_device_test("builtin:default");
  ASSERT_TRUE(loaded);
  const AovSet beauty = AovSet().set(static_cast<std::size_t>(Aov::beauty));
  const Framebuffer expected =
      render_on({render::DeviceKind::cpu, 0}, *loaded, 320, 180, beauty, 4);
  const Framebuffer found = render_on(GetParam(), *loaded, 320, 180, beauty, 4);
  std::vector<double> errors;
  for (std::size_t i = 0; i < expected.floats(Aov::beauty).size(); ++i) {
    const double a = expected.floats(Aov::beauty)[i], b = found.floats(Aov::beauty)[i];
    ASSERT_TRUE(std::isfinite(b));
    errors.push_back(std::abs(a - b) / std::max(std::abs(a), 1e-3));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LE(errors[errors.size() * 999 / 1000], 1e-4);
}

TEST_P(OnDevice, EveryRealSceneHasTheBitsOfTheCpu) {
  const std::filesystem::path folder = scenes_folder() / "valid";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".gltf" || entry.path().extension() == ".glb") {
      files.push_back(entry.path().string());
    }
  }
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty());
  // The CPU against itself says only that the test runs; a small image is enough for that.
  const bool gpu = GetParam().kind == render::DeviceKind::cuda;
  const std::uint32_t width = gpu ? 1280 : 64, height = gpu ? 720 : 36;
  for (const std::string& file : files) {
    const auto loaded = load_for_device_test(file);
    if (!loaded) continue;
    Framebuffer expected =
        render_on({render::DeviceKind::cpu, 0}, *loaded, width, height, geometry_aovs());
    Framebuffer found = render_on(GetParam(), *loaded, width, height, geometry_aovs());
    EXPECT_EQ(0u, differing_bits(expected, found)) << file;
  }
  RecordProperty("scenes", static_cast<int>(files.size()));
}

TEST_P(OnDevice, CancelLeavesAtOnce) {
  const auto loaded = load_for_device_test("builtin:paper");
  ASSERT_TRUE(loaded);
  Framebuffer framebuffer(640, 480, geometry_aovs());
  const std::atomic<bool> cancel{true};
  render::Settings settings;
  settings.cancel = &cancel;
  const auto renderer = render::make_renderer(loaded->scene, loaded->octree, GetParam());
  const auto result =
      renderer->render(scene::make_ray_camera(first_camera(loaded->scene, 4.0 / 3.0), 640, 480),
                       settings, framebuffer);
  ASSERT_FALSE(result);
  EXPECT_EQ("CANCELLED", result.error().code);
}

INSTANTIATE_TEST_SUITE_P(Devices, OnDevice, testing::ValuesIn(devices()),
                         [](const auto& p) { return device_name(p.param); });

}  // namespace
}  // namespace octrace::tests
