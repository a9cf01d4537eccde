// Small palette PNGs in memory, and text for embedding them in a page.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace octrace::validation {

using Rgb = std::array<std::uint8_t, 3>;

// indices: one a pixel, rows from the top, each below palette.size(), which is at most 256. The
// fewest bits a pixel that hold the palette are used.
std::string encode_palette_png(std::uint32_t width, std::uint32_t height,
                               std::span<const std::uint8_t> indices, std::span<const Rgb> palette);

// RGB, 8 bits a channel, three bytes a pixel.
std::string encode_rgb_png(std::uint32_t width, std::uint32_t height,
                           std::span<const std::uint8_t> samples);

std::string base64(std::string_view bytes);

}  // namespace octrace::validation
