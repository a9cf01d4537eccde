#include <gtest/gtest.h>

#include "backend/image/encoded_header.h"
#include "tests/unit/image_png_builder.h"

namespace octrace::test {
namespace {

using image::EncodedFormat;
using image::read_encoded_header;

Bytes jpeg_with_size(std::uint8_t height, std::uint8_t width) {
  return {0xff, 0xd8,                       // SOI
          0xff, 0xe0, 0,    4,    1,    2,  // APP0
          0xff, 0xff, 0xc2, 0,    11,   8,    0,    height, 0,  width,
          1,    1,    0x11, 0,                                      // fill byte, SOF2
          0xff, 0xda, 0,    8,    1,    1,    0,    0,      63, 0,  // SOS
          0x12, 0xff, 0x00, 0x34, 0xff, 0xd0, 0x56,                 // a scan with a restart
          0xff, 0xd9};                                              // EOI
}

TEST(EncodedHeader, Png) {
  const auto header =
      read_encoded_header(make_png({3, 2, 8, PngColor::grey, Bytes(6), {}, {}, ""}));
  ASSERT_TRUE(header);
  EXPECT_EQ(header->format, EncodedFormat::png);
  EXPECT_EQ(header->width, 3u);
  EXPECT_EQ(header->height, 2u);
}

TEST(EncodedHeader, Jpeg) {
  Bytes bytes = jpeg_with_size(20, 30);
  auto header = read_encoded_header(bytes);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->format, EncodedFormat::jpeg);
  EXPECT_EQ(header->width, 30u);
  EXPECT_EQ(header->height, 20u);
  EXPECT_TRUE(header->complete);
  bytes.resize(bytes.size() - 2);
  header = read_encoded_header(bytes);
  ASSERT_TRUE(header);
  EXPECT_FALSE(header->complete);
  EXPECT_FALSE(read_encoded_header(jpeg_with_size(0, 30)));
}

TEST(EncodedHeader, WebpOfAllThreeKinds) {
  Bytes extended = {'R', 'I', 'F', 'F', 0, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8',
                    'X', 10,  0,   0,   0, 0, 0, 0, 0,   3,   1,   0,   4,   0,   0};
  auto header = read_encoded_header(extended);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 260u);
  EXPECT_EQ(header->height, 5u);
  Bytes lossy = extended;
  lossy[15] = ' ';
  lossy[26] = 7;
  lossy[27] = 0x41;  // the two upper bits are a scale, not part of the width
  lossy[28] = 9;
  lossy[29] = 0;
  header = read_encoded_header(lossy);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 263u);
  EXPECT_EQ(header->height, 9u);
  Bytes lossless = extended;
  lossless[15] = 'L';
  lossless[20] = 0x2f;
  lossless[21] = 0xff;  // 14 bits of width - 1, 14 bits of height - 1
  lossless[22] = 0xc0;
  lossless[23] = 0x01;
  lossless[24] = 0x00;
  header = read_encoded_header(lossless);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 256u);
  EXPECT_EQ(header->height, 8u);
}

TEST(EncodedHeader, ShortBytesAreNone) {
  for (const Bytes& whole :
       {make_png({3, 2, 8, PngColor::grey, Bytes(6), {}, {}, ""}), jpeg_with_size(20, 30)}) {
    for (std::size_t size = 0; size < 20; ++size) {
      const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_FALSE(read_encoded_header(part));
    }
  }
}

}  // namespace
}  // namespace octrace::test
