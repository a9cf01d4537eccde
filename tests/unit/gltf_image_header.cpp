#include "backend/gltf/image_header.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/malformed/base_scene.h"

namespace octrace::gltf {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::string describe(const Bytes& bytes) {
  const auto header = read_image_header(bytes);
  if (!header) return header.error().code;
  return std::string(header->mime) + " " + std::to_string(header->width) + "x" +
         std::to_string(header->height);
}

void expect_each_truncation_fails(const Bytes& whole, std::size_t needed) {
  for (std::size_t size = 0; size < needed; ++size) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const auto header = read_image_header(part);
    ASSERT_FALSE(header) << size;
    EXPECT_TRUE(header.error().code == "IMAGE_UNEXPECTED_EOS" ||
                header.error().code == "IMAGE_UNRECOGNIZED_FORMAT")
        << size << " " << header.error().code;
  }
}

TEST(ImageHeader, Png) {
  Bytes png = tests::tiny_png();
  EXPECT_EQ(describe(png), "image/png 1x1");
  png[18] = 2;  // width 0x0201
  png[23] = 7;
  EXPECT_EQ(describe(png), "image/png 513x7");
  expect_each_truncation_fails(png, png.size() - 12);
  Bytes broken = png;
  broken[24] = 3;  // bits a channel
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
  broken = png;
  broken[12] = 'J';
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
  broken = png;
  for (int i = 16; i < 20; ++i) broken[static_cast<std::size_t>(i)] = 0;
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
  broken = png;
  broken[33] = 0xff;  // an IDAT of 4 GiB
  EXPECT_EQ(describe(broken), "IMAGE_UNEXPECTED_EOS");
}

TEST(ImageHeader, Jpeg) {
  const Bytes jpeg{0xff, 0xd8, 0xff, 0xe0, 0,    4, 'J', 'F',            // SOI, APP0
                   0xff, 0xff, 0xc2, 0,    17,   8, 1,   2,    3, 4, 3,  // fill, SOF2: 772 x 258
                   1,    0x22, 0,    2,    0x11, 1, 3,   0x11, 1};
  EXPECT_EQ(describe(jpeg), "image/jpeg 772x258");
  expect_each_truncation_fails(jpeg, jpeg.size());
  Bytes broken = jpeg;
  broken[5] = 1;  // a segment shorter than its own length
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
  broken = jpeg;
  broken[10] = 0xda;  // a scan before the frame
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
  broken = jpeg;
  broken[18] = 4;  // more components than the header holds
  EXPECT_EQ(describe(broken), "IMAGE_DATA_INVALID");
}

TEST(ImageHeader, WebP) {
  const auto riff = [](const std::string& chunk, Bytes body) {
    const std::string header = "RIFF____WEBP" + chunk;
    Bytes bytes(header.begin(), header.end());
    bytes[5] = bytes[6] = bytes[7] = 0;
    for (const std::size_t size : {body.size(), std::size_t{0}, std::size_t{0}, std::size_t{0}}) {
      bytes.push_back(static_cast<std::uint8_t>(size));
    }
    for (const std::uint8_t byte : body) bytes.push_back(byte);
    bytes[4] = static_cast<std::uint8_t>(bytes.size() - 8);
    return bytes;
  };
  const Bytes lossy = riff("VP8 ", {0, 0, 0, 0x9d, 1, 0x2a, 0x10, 0x40, 0x20, 0});
  EXPECT_EQ(describe(lossy), "image/webp 16x32");
  const Bytes lossless = riff("VP8L", {0x2f, 0x0f, 0xc0, 0x07, 0, 0});
  EXPECT_EQ(describe(lossless), "image/webp 16x32");
  const Bytes extended = riff("VP8X", {0, 0, 0, 0, 15, 0, 0, 31, 0, 0});
  EXPECT_EQ(describe(extended), "image/webp 16x32");
  expect_each_truncation_fails(lossy, lossy.size());
  expect_each_truncation_fails(lossless, lossless.size());
  expect_each_truncation_fails(extended, extended.size());
  EXPECT_EQ(describe(riff("ALPH", {0, 0, 0, 0, 0, 0, 0, 0, 0, 0})), "IMAGE_DATA_INVALID");
}

TEST(ImageHeader, Others) {
  EXPECT_EQ(describe({}), "IMAGE_UNEXPECTED_EOS");
  EXPECT_EQ(describe({'G', 'I', 'F', '8', '9', 'a', 1, 0}), "IMAGE_UNRECOGNIZED_FORMAT");
}

}  // namespace
}  // namespace octrace::gltf
