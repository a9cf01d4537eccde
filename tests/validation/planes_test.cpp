#include "validation/compare/planes.h"

#include <gtest/gtest.h>

#include <cmath>

namespace octrace::validation::test {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

image::Image image_of(std::uint32_t width, std::uint32_t height,
                      std::vector<std::pair<std::string, std::vector<float>>> channels) {
  image::Image image;
  image.width = width;
  image.height = height;
  for (auto& [name, values] : channels) {
    image::Image::Plane plane;
    plane.name = name;
    plane.floats = std::move(values);
    image.planes.push_back(std::move(plane));
  }
  return image;
}

TEST(Planes, OctraceChannels) {
  image::Image image = image_of(3, 1,
                                {{"R", {1, 2, 3}},
                                 {"G", {0, 0, 0}},
                                 {"B", {0, 0, 0}},
                                 {"A", {1, 1, 0}},
                                 {"Z", {2, 3, kInf}},
                                 {"mask", {1, 1, 0}}});
  image::Image::Plane id;
  id.name = "object_id";
  id.type = image::SampleType::uint32;
  id.uints = {7, 70000, 0};
  image.planes.push_back(id);
  const auto planes = planes_from_image(image, "a.exr");
  ASSERT_TRUE(planes);
  EXPECT_EQ(planes->mask, (std::vector<std::uint8_t>{1, 1, 0}));
  EXPECT_EQ(planes->z, (std::vector<float>{2, 3, kInf}));
  EXPECT_EQ(planes->object_id, (std::vector<std::uint32_t>{7, 70000, 0}));
  EXPECT_EQ(planes->rgb.size(), 9u);
  EXPECT_EQ(planes->rgb[3], 2.0f);
}

TEST(Planes, BlenderMultilayer) {
  const auto planes = planes_from_image(image_of(2, 2,
                                                 {{"ViewLayer.Combined.R", {1, 1, 1, 0}},
                                                  {"ViewLayer.Combined.A", {1, 1, 1, 0}},
                                                  {"ViewLayer.Depth.Z", {4, 5, 6, 1e10f}},
                                                  {"ViewLayer.IndexOB.X", {1, 2, 3, 0}}}),
                                        "b.exr");
  ASSERT_TRUE(planes);
  EXPECT_EQ(planes->mask, (std::vector<std::uint8_t>{1, 1, 1, 0}));
  EXPECT_EQ(planes->z, (std::vector<float>{4, 5, 6, kInf}));
  EXPECT_EQ(planes->object_id, (std::vector<std::uint32_t>{1, 2, 3, 0}));
  EXPECT_TRUE(planes->rgb.empty());
  EXPECT_EQ(planes->depth_channel, "ViewLayer.Depth.Z");
}

TEST(Planes, PlainDepthGivesTheMask) {
  for (const char* name : {"Z", "depth", "Depth", "depth.Z", "Depth.V"}) {
    const auto planes = planes_from_image(image_of(3, 1, {{name, {1, kInf, 1e10f}}}), "c.exr");
    ASSERT_TRUE(planes) << name;
    EXPECT_EQ(planes->mask, (std::vector<std::uint8_t>{1, 0, 0})) << name;
  }
}

TEST(Planes, AlphaAloneGivesTheMask) {
  const auto planes = planes_from_image(image_of(4, 1, {{"A", {0, 0.4f, 0.5f, 1}}}), "d.exr");
  ASSERT_TRUE(planes);
  EXPECT_EQ(planes->mask, (std::vector<std::uint8_t>{0, 0, 1, 1}));
  EXPECT_TRUE(planes->z.empty());
}

TEST(Planes, AnOpaquePictureHasNoSilhouette) {
  const auto planes = planes_from_image(
      image_of(2, 1, {{"R", {0, 1}}, {"G", {0, 1}}, {"B", {0, 1}}, {"A", {1, 1}}}), "p.png");
  ASSERT_TRUE(planes);
  EXPECT_TRUE(planes->mask.empty());
  EXPECT_EQ(planes->rgb.size(), 6u);
}

TEST(Planes, DepthBehindTheMaskIsNothing) {
  const auto planes = planes_from_image(image_of(2, 1, {{"A", {1, 0}}, {"Z", {1, 0}}}), "e.exr");
  ASSERT_TRUE(planes);
  EXPECT_EQ(planes->z, (std::vector<float>{1, kInf}));
}

TEST(Planes, ErrorsSayWhatIsThere) {
  const struct {
    image::Image image;
    const char* message;
  } cases[] = {
      {image_of(0, 0, {}), "no pixels"},
      {image_of(1, 1, {}), "channels are: none"},
      {image_of(1, 1, {{"N.X", {1}}, {"uv.X", {1}}}), "channels are: N.X, uv.X"},
      {image_of(2, 1, {{"Z", {1}}}), "has 1 samples"},
      {image_of(2, 1, {{"Z", {1, NAN}}}), "not a number at pixel (1, 0)"},
      {image_of(1, 2, {{"A", {1, NAN}}}), "not a number at pixel (0, 1)"},
  };
  for (const auto& [image, message] : cases) {
    const auto planes = planes_from_image(image, "f.exr");
    ASSERT_FALSE(planes) << message;
    EXPECT_EQ(planes.error().exit, util::Exit::invalid_input);
    EXPECT_EQ(planes.error().file, "f.exr");
    EXPECT_NE(planes.error().message.find(message), std::string::npos) << planes.error().message;
  }
}

TEST(Povray, DecodesThirtyBitDepths) {
  // The encoder's side, from its definition: the nearest step of far / 2^30.
  const double far = 37.5;
  std::vector<float> r, g, b;
  std::vector<double> depths{0.001, 1.0, 12.3456789, 37.4999};
  for (const double depth : depths) {
    const auto q = static_cast<std::uint32_t>(std::floor(depth / far * 1073741824.0 + 0.5));
    r.push_back(static_cast<float>(q / 32768) / 65535.0f);
    g.push_back(static_cast<float>(q % 32768) / 65535.0f);
    b.push_back(9 / 65535.0f);
  }
  r.push_back(0), g.push_back(0), b.push_back(0);
  const auto planes =
      planes_from_povray(image_of(5, 1, {{"R", r}, {"G", g}, {"B", b}}), far, "p.png");
  ASSERT_TRUE(planes);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    // Half a step, and half a unit in the last place of a float.
    EXPECT_NEAR(planes->z[i], depths[i], far * 0x1p-31 + depths[i] * 0x1p-24) << depths[i];
    EXPECT_EQ(planes->mask[i], 1);
    EXPECT_EQ(planes->object_id[i], 9u);
  }
  EXPECT_EQ(planes->mask[4], 0);
  EXPECT_EQ(planes->z[4], kInf);
}

TEST(Povray, AGammaIsNoticed) {
  const auto planes = planes_from_povray(
      image_of(1, 1, {{"R", {0.7f}}, {"G", {0.1f}}, {"B", {0.1f}}}), 1.0, "p.png");
  ASSERT_FALSE(planes);
  EXPECT_NE(planes.error().message.find("gamma"), std::string::npos);
}

TEST(Povray, NeedsThreeChannels) {
  const auto planes = planes_from_povray(image_of(1, 1, {{"Y", {0}}}), 1.0, "p.png");
  ASSERT_FALSE(planes);
  EXPECT_NE(planes.error().message.find("channels are: Y"), std::string::npos);
}

}  // namespace
}  // namespace octrace::validation::test
