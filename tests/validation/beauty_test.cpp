#include "validation/compare/beauty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "validation/compare/flip.h"

namespace octrace::validation::test {
namespace {

constexpr std::uint32_t kWidth = 64, kHeight = 48;

Planes beauty() {
  Planes planes;
  planes.width = kWidth;
  planes.height = kHeight;
  for (int y = 0; y < int{kHeight}; ++y) {
    for (int x = 0; x < int{kWidth}; ++x) {
      planes.rgb.push_back(static_cast<float>(x / double{kWidth}));
      planes.rgb.push_back(static_cast<float>(y / double{kHeight}));
      planes.rgb.push_back(static_cast<float>(0.5 + 0.5 * std::sin(0.3 * x + 0.2 * y)));
    }
  }
  return planes;
}

float& sample(Planes& planes, std::uint32_t x, std::uint32_t y, std::uint32_t c) {
  return planes.rgb[3 * (std::size_t{y} * kWidth + x) + c];
}

// A darker rectangle, a red spot, a brighter right edge.
Planes changed_beauty() {
  Planes planes = beauty();
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      for (std::uint32_t c = 0; c < 3; ++c) {
        float& value = sample(planes, x, y, c);
        if (y >= 10 && y < 20 && x >= 10 && x < 30) value *= 0.5f;
        if (y >= 30 && y < 34 && x >= 40 && x < 44) value = c == 0 ? 1.0f : 0.0f;
        if (x >= 50) value = std::min(1.0f, value + 0.05f);
      }
    }
  }
  return planes;
}

// The figures come from a second implementation of the paper, in Python and with two-dimensional
// filters, that was checked against the authors' own text.
TEST(Flip, AgreesWithASecondImplementation) {
  const Planes reference = beauty(), test = changed_beauty();
  const std::vector<float> map = flip(reference.rgb, test.rgb, kWidth, kHeight);
  double mean = 0.0;
  for (const float value : map) mean += value;
  EXPECT_NEAR(mean / static_cast<double>(map.size()), 0.10593125656, 1e-6);
  const struct {
    std::uint32_t x, y;
    double value;
  } expected[] = {{0, 0, 4.1675e-06},        {10, 10, 0.34233016888}, {20, 15, 0.63013437000},
                  {42, 32, 0.97412803854},   {50, 5, 0.15493335315},  {63, 47, 0.12963200079},
                  {35, 40, 0.00038174495732}};
  for (const auto& [x, y, value] : expected) {
    EXPECT_NEAR(map[std::size_t{y} * kWidth + x], value, 2e-6) << x << ", " << y;
  }
}

TEST(Flip, EqualImagesLookEqual) {
  const Planes image = beauty();
  for (const float value : flip(image.rgb, image.rgb, kWidth, kHeight)) ASSERT_EQ(value, 0.0f);
}

TEST(Flip, IsSymmetricAndWithinItsRange) {
  const Planes a = beauty(), b = changed_beauty();
  const auto forth = flip(a.rgb, b.rgb, kWidth, kHeight);
  const auto back = flip(b.rgb, a.rgb, kWidth, kHeight);
  for (std::size_t i = 0; i < forth.size(); ++i) {
    ASSERT_NEAR(forth[i], back[i], 1e-6);
    ASSERT_GE(forth[i], 0.0f);
    ASSERT_LE(forth[i], 1.0f);
  }
}

TEST(Flip, BlackAndWhiteAreFarApart) {
  const std::vector<float> black(3 * 32 * 32, 0.0f), white(3 * 32 * 32, 1.0f);
  for (const float value : flip(black, white, 32, 32)) ASSERT_GT(value, 0.95f);
}

TEST(Beauty, RmseOfAConstantDifference) {
  Planes a = beauty(), b = beauty();
  std::fill(a.rgb.begin(), a.rgb.end(), 0.75f);
  std::fill(b.rgb.begin(), b.rgb.end(), 0.5f);
  auto metrics = compare_beauty(a, b);
  ASSERT_TRUE(metrics);
  EXPECT_DOUBLE_EQ(metrics->rmse, 0.25);
  EXPECT_FALSE(judge(*metrics, kDefaultTolerances)[0].passed());
}

TEST(Beauty, HighlightsBeyondWhiteAreWhite) {
  Planes a = beauty(), b = beauty();
  std::fill(a.rgb.begin(), a.rgb.end(), 7.0f);
  std::fill(b.rgb.begin(), b.rgb.end(), 1.0f);
  auto metrics = compare_beauty(a, b);
  ASSERT_TRUE(metrics);
  EXPECT_EQ(metrics->rmse, 0.0);
  EXPECT_EQ(metrics->flip_mean, 0.0);
}

TEST(Beauty, ErrorsNameWhatIsMissing) {
  Planes a = beauty(), b = beauty();
  b.rgb.clear();
  auto metrics = compare_beauty(a, b);
  ASSERT_FALSE(metrics);
  EXPECT_NE(metrics.error().message.find("second image"), std::string::npos);
  b = beauty();
  b.width = 32;
  b.height = 96;
  metrics = compare_beauty(a, b);
  ASSERT_FALSE(metrics);
  EXPECT_NE(metrics.error().message.find("64x48 and 32x96"), std::string::npos);
}

}  // namespace
}  // namespace octrace::validation::test
