// PNG files made without any image library, in every layout that the format has.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace octrace::test {

using Bytes = std::vector<std::uint8_t>;

enum class PngColor : std::uint8_t { grey = 0, rgb = 2, palette = 3, grey_alpha = 4, rgba = 6 };

struct PngLayout {
  std::uint32_t width = 1, height = 1;
  std::uint8_t depth = 8;
  PngColor color = PngColor::rgba;
  Bytes samples;                // rows as the file holds them, big-endian, without filter bytes
  Bytes palette, transparency;  // PLTE and tRNS; empty: none
  std::string color_chunk;      // "gAMA" and "sRGB" must not change the values
};

Bytes make_png(const PngLayout& layout);

}  // namespace octrace::test
