#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "backend/image/image.h"

namespace octrace::test {
namespace {

using image::Encoding;
using ::testing::ElementsAre;

class Integer : public ::testing::TestWithParam<const char*> {
 protected:
  Integer()
      : path_((std::filesystem::temp_directory_path() /
               ("octrace_integer_" + std::to_string(::getpid()) + GetParam()))
                  .string()) {}
  ~Integer() override { std::filesystem::remove(path_); }

  // Writes one row of pixels and reads it back as the file's own integers.
  std::vector<std::vector<long>> round_trip(const std::vector<std::vector<float>>& pixels,
                                            Encoding encoding, double scale = 1.0) {
    const std::size_t channels = pixels[0].size();
    std::vector<float> samples;
    for (const auto& pixel : pixels) samples.insert(samples.end(), pixel.begin(), pixel.end());
    image::ImageView view{static_cast<std::uint32_t>(pixels.size()), 1, {}, {}};
    const char* names[] = {"R", "G", "B", "A"};
    for (std::size_t c = 0; c < channels; ++c) {
      view.channels.push_back(
          {names[c], image::SampleType::float32, samples.data() + c, channels * 4});
    }
    const util::Result<void> written = image::write_integer(path_, view, encoding, scale);
    EXPECT_TRUE(written) << written.error().to_string();
    const double largest = encoding == Encoding::scaled16 ? 65535.0 : 255.0;
    const util::Result<image::Image> image = image::read(path_, {});
    EXPECT_TRUE(image) << image.error().to_string();
    std::vector<std::vector<long>> out(pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      for (const auto& plane : image->planes) {
        out[i].push_back(std::lround(plane.floats[i] * largest));
      }
    }
    return out;
  }
  std::string path_;
};

// round(255 * IEC 61966-2-1), computed here by the formula.
long srgb(double linear) {
  const double v = linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
  return std::lround(std::clamp(v, 0.0, 1.0) * 255.0);
}

TEST_P(Integer, BeautyIsSrgbWithUnassociatedAlpha) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(round_trip({{0.5f, 0.0f, 1.0f, 1.0f},
                          {0.25f, 0.1f, 0.0f, 0.5f},
                          {0.0f, 0.0f, 0.0f, 0.0f},
                          {7.0f, -1.0f, nan, 1.0f}},
                         Encoding::srgb8),
              ElementsAre(ElementsAre(188, 0, 255, 255), ElementsAre(188, srgb(0.2), 0, 128),
                          ElementsAre(0, 0, 0, 0), ElementsAre(255, 0, 0, 255)));
}

TEST_P(Integer, SrgbCurveIsTheFormulasEverywhere) {
  std::vector<std::vector<float>> pixels;
  for (int i = 0; i <= 4000; ++i) {
    const float value = static_cast<float>(i) / 4000.0f;
    pixels.push_back({value, value, value});
  }
  const auto found = round_trip(pixels, Encoding::srgb8);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    ASSERT_EQ(found[i][0], srgb(pixels[i][0])) << pixels[i][0];
  }
}

TEST_P(Integer, NormalsAndMasks) {
  EXPECT_THAT(round_trip({{-1.0f, 0.0f, 1.0f}}, Encoding::signed8),
              ElementsAre(ElementsAre(0, 128, 255)));
  EXPECT_THAT(round_trip({{0.0f}, {1.0f}, {0.5f}}, Encoding::linear8),
              ElementsAre(ElementsAre(0), ElementsAre(255), ElementsAre(128)));
  EXPECT_THAT(round_trip({{0.25f, 2.0f}}, Encoding::linear8), ElementsAre(ElementsAre(64, 255, 0)));
}

TEST_P(Integer, DepthIsScaledAndClamped) {
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_THAT(round_trip({{1.5f}, {65.534f}, {65.5345f}, {65.6f}, {infinity}, {0.0004f}, {-1.0f}},
                         Encoding::scaled16, 1000.0),
              ElementsAre(ElementsAre(1500), ElementsAre(65534), ElementsAre(65535),
                          ElementsAre(65535), ElementsAre(65535), ElementsAre(0), ElementsAre(0)));
}

TEST_P(Integer, IdsAreExactOrAnError) {
  std::vector<std::uint32_t> ids = {0, 1, 255, 256, 65535};
  image::ImageView view{5, 1, {{"object_id", image::SampleType::uint32, ids.data(), 4}}, {}};
  ASSERT_TRUE(image::write_integer(path_, view, Encoding::index16, 1.0));
  const util::Result<image::Image> image = image::read(path_, {});
  ASSERT_TRUE(image);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(std::lround(image->planes[0].floats[i] * 65535.0), static_cast<long>(ids[i]));
  }
  std::filesystem::remove(path_);
  ids[2] = 65536;
  const util::Result<void> written = image::write_integer(path_, view, Encoding::index16, 1.0);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().exit, util::Exit::limit);
  EXPECT_THAT(written.error().message, ::testing::HasSubstr("object_id 65536"));
  EXPECT_FALSE(std::filesystem::exists(path_));
}

INSTANTIATE_TEST_SUITE_P(Lossless, Integer, ::testing::Values(".png", ".tif"));

}  // namespace
}  // namespace octrace::test
