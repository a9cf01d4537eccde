// builtin:default against a checked-in image of all planes. After a wanted change, run this test
// with OCTRACE_UPDATE_GOLDEN=1 set, look at the new image, and commit it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <set>

#include "backend/image/image.h"
#include "backend/octree/octree.h"
#include "backend/render/renderer.h"
#include "backend/scene/builtin.h"

namespace octrace {
namespace {

using render::AovInfo;

constexpr std::uint32_t kWidth = 64, kHeight = 48;
const char* const kFile = OCTRACE_GOLDEN_DATA "/default.exr";

// Thresholds. Planes of geometry may differ in a pixel only where a change of rounding moves an
// edge.
constexpr double kRelative = 2e-6;  // Z, distance, P; absolute for the other float planes
constexpr int kEdgePixels = 2;      // any one plane
// Beauty: the same random numbers, so all that may differ is rounding, and paths that it splits.
constexpr double kBeautyAbsolute = 2e-3;
constexpr int kBeautyPixels = 15;     // 0.5 % of the image
constexpr double kBeautyMean = 1e-4;  // mean of the difference

render::Framebuffer render_default() {
  const auto scene = scene::make_builtin("default");
  EXPECT_TRUE(scene);
  const auto octree = octree::build(*scene, {});
  EXPECT_TRUE(octree);
  render::Framebuffer framebuffer(kWidth, kHeight, *render::parse_aovs("all"));
  render::Settings settings;
  settings.params.spp = 16;
  const auto stats = render::make_cpu_renderer(*scene, *octree)
                         ->render(scene::make_ray_camera(scene->cameras.at(0), kWidth, kHeight),
                                  settings, framebuffer);
  EXPECT_TRUE(stats);
  return framebuffer;
}

image::ImageView image_of(const render::Framebuffer& framebuffer) {
  image::ImageView view;
  view.width = framebuffer.width();
  view.height = framebuffer.height();
  for (const AovInfo& info : render::aov_table()) {
    const auto stride = static_cast<std::size_t>(info.channel_count) * 4;
    for (int c = 0; c < info.channel_count; ++c) {
      const auto* first = info.uint32
                              ? reinterpret_cast<const char*>(framebuffer.uints(info.aov).data())
                              : reinterpret_cast<const char*>(framebuffer.floats(info.aov).data());
      view.channels.push_back({std::string(info.channels[static_cast<std::size_t>(c)]),
                               info.uint32 ? image::SampleType::uint32 : image::SampleType::float32,
                               first + 4 * c, stride});
    }
  }
  return view;
}

bool close(float a, float b, bool relative) {
  if (std::isinf(a) || std::isinf(b)) return a == b;
  const double scale = relative ? std::max(std::abs(b), 1.0f) : 1.0;
  return std::abs(double(a) - b) <= kRelative * scale;
}

class DefaultScene : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    framebuffer_ = std::make_unique<render::Framebuffer>(render_default());
    if (std::getenv("OCTRACE_UPDATE_GOLDEN") != nullptr) {
      const auto written = image::write_exr(kFile, image_of(*framebuffer_));
      ASSERT_TRUE(written) << written.error().to_string();
    }
    auto golden = image::read(kFile, {});
    ASSERT_TRUE(golden) << golden.error().to_string();
    golden_ = std::make_unique<image::Image>(std::move(*golden));
    ASSERT_EQ(golden_->width, kWidth);
    ASSERT_EQ(golden_->height, kHeight);
  }
  static void TearDownTestSuite() {
    framebuffer_.reset();
    golden_.reset();
  }
  void SetUp() override { ASSERT_TRUE(golden_); }

  static inline std::unique_ptr<render::Framebuffer> framebuffer_;
  static inline std::unique_ptr<image::Image> golden_;
};

TEST_F(DefaultScene, GeometryPlanes) {
  for (const AovInfo& info : render::aov_table()) {
    if (info.aov == render::Aov::beauty || info.aov == render::Aov::motion) continue;
    const bool relative = info.aov == render::Aov::depth || info.aov == render::Aov::distance ||
                          info.aov == render::Aov::position;
    int different = 0;
    for (std::size_t pixel = 0; pixel < kWidth * kHeight; ++pixel) {
      bool same = true;
      for (int c = 0; c < info.channel_count; ++c) {
        const std::string name(info.channels[static_cast<std::size_t>(c)]);
        const auto* plane = golden_->find(name);
        ASSERT_NE(plane, nullptr) << name;
        const std::size_t at =
            pixel * static_cast<std::size_t>(info.channel_count) + static_cast<std::size_t>(c);
        same = same && (info.uint32 ? framebuffer_->uints(info.aov)[at] == plane->uints.at(pixel)
                                    : close(framebuffer_->floats(info.aov)[at],
                                            plane->floats.at(pixel), relative));
      }
      different += !same;
    }
    EXPECT_LE(different, kEdgePixels) << info.option;
  }
}

TEST_F(DefaultScene, Beauty) {
  const auto beauty = framebuffer_->floats(render::Aov::beauty);
  int different = 0;
  double sum = 0;
  for (std::size_t pixel = 0; pixel < kWidth * kHeight; ++pixel) {
    double worst = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const auto* plane = golden_->find(std::string(1, "RGBA"[c]));
      ASSERT_NE(plane, nullptr);
      const double difference = double(beauty[4 * pixel + c]) - plane->floats.at(pixel);
      worst = std::max(worst, std::abs(difference));
      sum += difference;
    }
    different += worst > kBeautyAbsolute;
  }
  EXPECT_LE(different, kBeautyPixels);
  EXPECT_LE(std::abs(sum) / (4.0 * kWidth * kHeight), kBeautyMean);
}

// What the scene is for: every plane has something in it.
TEST_F(DefaultScene, IsNotDull) {
  const auto distinct = [&](render::Aov aov) {
    const auto ids = framebuffer_->uints(aov);
    return std::set<std::uint32_t>(ids.begin(), ids.end()).size();
  };
  EXPECT_GE(distinct(render::Aov::object_id), 10u);
  EXPECT_GE(distinct(render::Aov::material_id), 8u);
  double covered = 0;
  for (const float m : framebuffer_->floats(render::Aov::mask)) covered += m;
  EXPECT_GT(covered, 0.4 * kWidth * kHeight);
  EXPECT_LT(covered, 0.9 * kWidth * kHeight);
}

}  // namespace
}  // namespace octrace
