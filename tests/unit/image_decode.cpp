#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "backend/image/image.h"
#include "tests/unit/image_png_builder.h"

namespace octrace::test {
namespace {

using ::testing::ElementsAre;
using util::Exit;

std::uint32_t rgba(unsigned r, unsigned g, unsigned b, unsigned a) {
  return r | g << 8 | b << 16 | a << 24;
}

image::Rgba8 decoded(const Bytes& bytes, const std::string& mime = "image/png") {
  util::Result<image::Rgba8> image = image::decode(bytes, mime, {});
  EXPECT_TRUE(image) << image.error().to_string();
  return image ? std::move(*image) : image::Rgba8{};
}

TEST(DecodePng, EveryLayoutBecomesRgba8) {
  const auto texels = [](const PngLayout& layout) { return decoded(make_png(layout)).texels; };
  EXPECT_THAT(texels({2, 1, 8, PngColor::grey, {7, 200}, {}, {}, ""}),
              ElementsAre(rgba(7, 7, 7, 255), rgba(200, 200, 200, 255)));
  EXPECT_THAT(texels({2, 1, 8, PngColor::grey_alpha, {7, 128, 200, 0}, {}, {}, ""}),
              ElementsAre(rgba(7, 7, 7, 128), rgba(200, 200, 200, 0)));
  EXPECT_THAT(texels({1, 2, 8, PngColor::rgb, {1, 2, 3, 4, 5, 6}, {}, {}, ""}),
              ElementsAre(rgba(1, 2, 3, 255), rgba(4, 5, 6, 255)));
  EXPECT_THAT(texels({1, 1, 16, PngColor::rgb, {0xff, 0xff, 0x80, 0x80, 0, 0}, {}, {}, ""}),
              ElementsAre(rgba(255, 128, 0, 255)));
  EXPECT_THAT(texels({8, 1, 1, PngColor::grey, {0b10100000}, {}, {}, ""})[2],
              rgba(255, 255, 255, 255));
  EXPECT_THAT(texels({4, 1, 2, PngColor::grey, {0b00011011}, {}, {}, ""}),
              ElementsAre(rgba(0, 0, 0, 255), rgba(85, 85, 85, 255), rgba(170, 170, 170, 255),
                          rgba(255, 255, 255, 255)));
}

TEST(DecodePng, PalettesAreLookedUp) {
  const Bytes palette = {10, 20, 30, 40, 50, 60};
  EXPECT_THAT(decoded(make_png({2, 1, 8, PngColor::palette, {1, 0}, palette, {}, ""})).texels,
              ElementsAre(rgba(40, 50, 60, 255), rgba(10, 20, 30, 255)));
  EXPECT_THAT(
      decoded(make_png({2, 1, 8, PngColor::palette, {1, 0}, palette, {255, 100}, ""})).texels,
      ElementsAre(rgba(40, 50, 60, 100), rgba(10, 20, 30, 255)));
}

// glTF keeps colours apart from alpha and says itself which texture is sRGB.
TEST(DecodePng, AlphaAndColourSpaceLeaveColoursAlone) {
  for (const char* chunk : {"", "gAMA", "sRGB"}) {
    EXPECT_THAT(
        decoded(make_png({2, 1, 8, PngColor::rgba, {200, 100, 50, 0, 9, 8, 7, 51}, {}, {}, chunk}))
            .texels,
        ElementsAre(rgba(200, 100, 50, 0), rgba(9, 8, 7, 51)))
        << chunk;
  }
}

TEST(DecodePng, BrokenFilesAreErrorsAtEveryLength) {
  Bytes samples(12 * 9 * 4);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<std::uint8_t>(i * 7);
  const Bytes whole = make_png({12, 9, 8, PngColor::rgba, samples, {}, {}, ""});
  // The last 16 bytes are the checksums and the end chunk, which decoders need not read.
  for (std::size_t size = 0; size + 16 < whole.size(); size += 3) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const util::Result<image::Rgba8> image = image::decode(part, "image/png", {});
    ASSERT_FALSE(image) << "of " << whole.size() << " bytes the first " << size;
    EXPECT_EQ(image.error().exit, Exit::invalid_input);
  }
}

TEST(Decode, LimitComesBeforeMemory) {
  Bytes huge = make_png({1, 1, 8, PngColor::grey, {0}, {}, {}, ""});
  for (const std::size_t at : {16u, 17u, 20u, 21u}) huge[at] = 0x3f;  // width and height
  const util::Result<image::Rgba8> image = image::decode(huge, "image/png", {});
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().exit, Exit::limit);
  EXPECT_THAT(image.error().message, ::testing::HasSubstr("--max-texture-pixels"));
  util::Limits limits;
  limits.max_texture_pixels = 3;
  const Bytes four = make_png({2, 2, 8, PngColor::grey, {1, 2, 3, 4}, {}, {}, ""});
  EXPECT_FALSE(image::decode(four, "image/png", limits));
  limits.max_texture_pixels = 4;
  EXPECT_TRUE(image::decode(four, "image/png", limits));
}

TEST(Decode, OtherBytesAreRefused) {
  for (const Bytes& bytes : {Bytes{}, Bytes{1, 2, 3}, Bytes(1000, 0), Bytes{'G', 'I', 'F', '8'}}) {
    const util::Result<image::Rgba8> image = image::decode(bytes, "image/png", {});
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, "IMAGE_DATA_INVALID");
  }
}

// Lossy with an alpha plane, of 4x2 pixels, written by libwebp.
constexpr std::uint8_t kWebp[] = {
    0x52, 0x49, 0x46, 0x46, 0x8e, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38,
    0x58, 0x0a, 0x00, 0x00, 0x00, 0x10, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x01, 0x00, 0x00,
    0x41, 0x4c, 0x50, 0x48, 0x09, 0x00, 0x00, 0x00, 0x00, 0x80, 0xff, 0x00, 0x00, 0xff, 0xff,
    0x00, 0x00, 0x00, 0x56, 0x50, 0x38, 0x20, 0x5e, 0x00, 0x00, 0x00, 0x50, 0x03, 0x00, 0x9d,
    0x01, 0x2a, 0x04, 0x00, 0x02, 0x00, 0x00, 0x00, 0x00, 0x25, 0x00, 0x4e, 0x8e, 0x40, 0x1f,
    0x80, 0x15, 0xa0, 0x1f, 0xc0, 0x32, 0x80, 0x3f, 0x40, 0x07, 0x38, 0x01, 0x99, 0x56, 0x23,
    0x30, 0x00, 0xfe, 0xf5, 0x62, 0x7f, 0xde, 0xdf, 0xdf, 0xf9, 0xdf, 0xff, 0x7f, 0xff, 0xc8,
    0xaf, 0x91, 0x5f, 0x22, 0x35, 0x25, 0xdc, 0xc2, 0xbb, 0xf5, 0x29, 0xe1, 0xd2, 0x9b, 0xff,
    0x9f, 0xf5, 0xb1, 0x85, 0xc6, 0x29, 0xff, 0xfb, 0x9c, 0x42, 0x45, 0xd6, 0x4f, 0xff, 0x61,
    0xc3, 0x9d, 0x9c, 0xc6, 0x44, 0xff, 0xfe, 0x87, 0x0e, 0x76, 0x73, 0x18, 0x40, 0x00, 0x00};

TEST(DecodeWebp, ColoursAreNotScaledByAlpha) {
  const image::Rgba8 image = decoded(Bytes(std::begin(kWebp), std::end(kWebp)), "image/webp");
  ASSERT_EQ(image.width, 4u);
  ASSERT_EQ(image.height, 2u);
  EXPECT_EQ(image.texels[1], rgba(216, 140, 104, 255));
  EXPECT_GT(image.texels[2] & 0xffffffu, 0u) << "colours where alpha is 0 are kept";
  EXPECT_EQ(image.texels[0] >> 24, 128u);
  EXPECT_NEAR(static_cast<double>(image.texels[0] & 255u), 142.0, 2.0);  // 71 if scaled
}

// Lossless with alpha, written by a browser from the pixels below.
constexpr std::uint8_t kLosslessWebp[] = {
    0x52, 0x49, 0x46, 0x46, 0x52, 0x00, 0x00, 0x00, 0x57, 0x45, 0x42, 0x50, 0x56, 0x50, 0x38,
    0x4c, 0x46, 0x00, 0x00, 0x00, 0x2f, 0x03, 0x40, 0x00, 0x10, 0x3f, 0x40, 0x10, 0x00, 0x21,
    0x82, 0x2d, 0x15, 0x6a, 0x34, 0x78, 0xb5, 0x41, 0x26, 0x60, 0xb1, 0xdb, 0x27, 0x8d, 0x2c,
    0x4a, 0x88, 0x2d, 0x07, 0x59, 0x80, 0xc9, 0x48, 0x26, 0x13, 0x7c, 0x5f, 0x24, 0x41, 0x10,
    0x69, 0xdb, 0xa6, 0xea, 0xea, 0x74, 0xf0, 0x01, 0x70, 0x48, 0xb2, 0xdc, 0xd7, 0x9d, 0x1b,
    0xdc, 0x2d, 0x03, 0xa1, 0x00, 0x1a, 0xc3, 0xc8, 0xa0, 0x1d, 0x4c, 0x11, 0xfd, 0x0f, 0x39};

TEST(DecodeWebp, LosslessIsExact) {
  const Bytes bytes(std::begin(kLosslessWebp), std::end(kLosslessWebp));
  EXPECT_THAT(decoded(bytes, "image/webp").texels,
              ElementsAre(rgba(200, 100, 50, 255), rgba(10, 20, 30, 128), rgba(255, 0, 0, 255),
                          rgba(0, 255, 0, 64), rgba(1, 2, 3, 255), rgba(90, 80, 70, 255),
                          rgba(0, 0, 0, 0), rgba(240, 120, 60, 200)));
}

TEST(DecodeWebp, TruncatedIsAnError) {
  for (const std::size_t size : {10u, 29u, 60u, 100u, 140u}) {
    EXPECT_FALSE(image::decode(Bytes(kWebp, kWebp + size), "image/webp", {})) << size;
  }
}

Bytes make_jpeg() {
  const std::string path =
      (std::filesystem::temp_directory_path() / "octrace_image_decode.jpg").string();
  std::vector<float> grey(40 * 30);
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<float>(i % 40) / 40.0f;
  image::ImageView view;
  view.width = 40;
  view.height = 30;
  for (const char* name : {"R", "G", "B"}) {
    view.channels.push_back({name, image::SampleType::float32, grey.data(), 4});
  }
  EXPECT_TRUE(image::write_integer(path, view, image::Encoding::linear8, 1.0));
  std::ifstream file(path, std::ios::binary);
  const Bytes bytes((std::istreambuf_iterator<char>(file)), {});
  std::filesystem::remove(path);
  return bytes;
}

TEST(DecodeJpeg, RampComesBack) {
  const image::Rgba8 image = decoded(make_jpeg(), "image/jpeg");
  ASSERT_EQ(image.texels.size(), 40u * 30u);
  for (std::size_t i = 0; i < image.texels.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(image.texels[i] & 255u),
                static_cast<double>(i % 40) / 40.0 * 255.0, 4.0);
    EXPECT_EQ(image.texels[i] >> 24, 255u);
  }
}

// libjpeg alone would fill the missing part with grey and go on.
TEST(DecodeJpeg, TruncatedIsAnErrorAtEveryLength) {
  const Bytes whole = make_jpeg();
  for (std::size_t size = 0; size + 1 < whole.size(); size += 5) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const util::Result<image::Rgba8> image = image::decode(part, "image/jpeg", {});
    ASSERT_FALSE(image) << size << " of " << whole.size();
    EXPECT_EQ(image.error().exit, Exit::invalid_input);
  }
}

TEST(Decode, FromManyThreads) {
  const Bytes png = make_png({2, 1, 8, PngColor::rgba, {200, 100, 50, 0, 9, 8, 7, 51}, {}, {}, ""});
  std::vector<std::thread> threads;
  std::atomic<int> right{0};
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      const util::Result<image::Rgba8> image = image::decode(png, "image/png", {});
      if (image && image->texels[0] == rgba(200, 100, 50, 0)) ++right;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 8);
}

}  // namespace
}  // namespace octrace::test
