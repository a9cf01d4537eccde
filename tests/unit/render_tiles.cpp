// The same bits for any threads, tiles and builder; progress, cancelling, and failing loudly.
#include <gtest/gtest.h>

#include <atomic>

#include "backend/scene/builtin.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using render::Aov;

std::uint64_t hash_planes(const render::Framebuffer& framebuffer) {
  std::uint64_t hash = 0xcbf29ce484222325ull;  // FNV-1a
  const auto add = [&](const void* data, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i)
      hash = (hash ^ static_cast<const unsigned char*>(data)[i]) * 0x100000001b3ull;
  };
  for (const render::AovInfo& info : render::aov_table()) {
    const auto floats = framebuffer.floats(info.aov);
    const auto uints = framebuffer.uints(info.aov);
    add(floats.data(), floats.size_bytes());
    add(uints.data(), uints.size_bytes());
  }
  return hash;
}

struct Case {
  unsigned threads;
  std::uint32_t tile;
  octree::Builder builder;
};

TEST(Tiles, SameBitsForAnyThreadsTilesAndBuilder) {
  const auto scene = scene::make_builtin("default");
  ASSERT_TRUE(scene);
  std::uint64_t first = 0;
  render::TraceStats first_stats;
  for (const Case& c :
       {Case{1, 8, octree::Builder::sah}, Case{2, 64, octree::Builder::sah},
        Case{5, 1, octree::Builder::median}, Case{2, 1000, octree::Builder::median}}) {
    octree::BuildOptions options;
    options.builder = c.builder;
    const auto octree = octree::build(*scene, options);
    ASSERT_TRUE(octree);
    render::Framebuffer framebuffer(67, 41, *render::parse_aovs("all"));
    render::Settings settings;
    settings.threads = c.threads;
    settings.tile = c.tile;
    settings.params.spp = 3;
    const auto stats =
        render::make_cpu_renderer(*scene, *octree)
            ->render(scene::make_ray_camera(scene->cameras.at(0), 67, 41), settings, framebuffer);
    ASSERT_TRUE(stats);
    const std::uint64_t hash = hash_planes(framebuffer);
    if (first == 0) {
      first = hash;
      first_stats = *stats;
    }
    EXPECT_EQ(hash, first) << c.threads << " threads, tile " << c.tile;
    EXPECT_EQ(stats->beauty_rays, first_stats.beauty_rays);
    EXPECT_EQ(stats->shadow_rays, first_stats.shadow_rays);
    EXPECT_EQ(stats->camera_rays, 67u * 41u);
    EXPECT_TRUE(stats->device.starts_with("cpu: ")) << stats->device;
    EXPECT_GT(stats->seconds, 0.0);
  }
}

TEST(Tiles, SeedChangesBeautyOnly) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0, 0, 0}, 1, 16, 8, true), add_material(scene, matte(Vec3(0.8f))));
  render::Settings a, b;
  b.params.seed = 1;
  const Rendered first = render_scene(scene, camera_at({0, 0, 4}, 0.8), 32, 32, a);
  const Rendered second = render_scene(scene, camera_at({0, 0, 4}, 0.8), 32, 32, b);
  const auto differ = [&](Aov aov) {
    const auto x = first.framebuffer.floats(aov), y = second.framebuffer.floats(aov);
    return !std::equal(x.begin(), x.end(), y.begin());
  };
  EXPECT_TRUE(differ(Aov::beauty));
  EXPECT_FALSE(differ(Aov::depth));
  EXPECT_FALSE(differ(Aov::normal));
}

TEST(Tiles, OnlyWhatIsAskedForIsTraced) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_quad({0, 0, 0}, 1), 0);
  const scene::Camera camera = camera_at({0, 0, 4}, 0.8);
  EXPECT_EQ(render_scene(scene, camera, 8, 8, {}, "Z").stats.beauty_rays, 0u);
  EXPECT_EQ(render_scene(scene, camera, 8, 8, {}, "beauty").stats.camera_rays, 0u);
}

TEST(Tiles, EmptySceneIsAllBackground) {
  const Rendered image = render_scene(empty_scene(), camera_at({0, 0, 4}, 0.8), 8, 8);
  const Vec4 sky(render::Settings{}.params.sky, 1.0f);
  for (int c = 0; c < 4; ++c) EXPECT_NEAR(image.rgba(3, 3)[c], sky[c], 1e-6);
  EXPECT_EQ(image.value(Aov::mask, 3, 3), 0.0f);
  EXPECT_EQ(image.stats.beauty_rays, 8u * 8 * 16);
}

TEST(Tiles, ProgressRisesToOne) {
  scene::Scene scene = empty_scene();
  std::vector<double> seen;
  render::Settings settings;
  settings.threads = 1;
  settings.tile = 4;
  settings.progress = [&](double share) { seen.push_back(share); };
  render_scene(scene, camera_at({0, 0, 4}, 0.8), 16, 16, settings, "mask");
  ASSERT_GE(seen.size(), 16u);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), 1.0);
}

TEST(Tiles, CancelStopsTheRender) {
  scene::Scene scene = empty_scene();
  const auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  std::atomic<bool> cancel = false;
  int reports = 0;
  render::Settings settings;
  settings.threads = 1;
  settings.tile = 4;
  settings.cancel = &cancel;
  settings.progress = [&](double) { cancel = ++reports == 3; };
  render::Framebuffer framebuffer(64, 64, *render::parse_aovs("mask"));
  const auto result = render::make_cpu_renderer(scene, *octree)
                          ->render(scene::make_ray_camera(camera_at({0, 0, 4}, 0.8), 64, 64),
                                   settings, framebuffer);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, "CANCELLED");
  EXPECT_EQ(reports, 3);
}

TEST(Tiles, BrokenOctreeFailsAndNamesThePixel) {
  scene::Scene scene = empty_scene();
  add_mesh(scene, make_ball({0, 0, 0}, 1, 64, 32, true), 0);
  auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  for (kernels::Node& node : octree->nodes) node.first_child = 0;  // children point at the root
  for (const char* aovs : {"Z", "beauty"}) {
    render::Framebuffer framebuffer(16, 16, *render::parse_aovs(aovs));
    const auto result =
        render::make_cpu_renderer(scene, *octree)
            ->render(scene::make_ray_camera(camera_at({0, 0, 2}, 0.8), 16, 16), {}, framebuffer);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().exit, util::Exit::internal);
    EXPECT_NE(result.error().message.find("pixel ("), std::string::npos) << result.error().message;
  }
}

TEST(Tiles, BeautyWithoutSamplesIsAnError) {
  scene::Scene scene = empty_scene();
  const auto octree = octree::build(scene, {});
  ASSERT_TRUE(octree);
  render::Settings settings;
  settings.params.spp = 0;
  render::Framebuffer framebuffer(4, 4, *render::parse_aovs("beauty"));
  const auto result =
      render::make_cpu_renderer(scene, *octree)
          ->render(scene::make_ray_camera(camera_at({0, 0, 4}, 0.8), 4, 4), settings, framebuffer);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().exit, util::Exit::usage);
}

}  // namespace
}  // namespace octrace::test
