// Texels as the bytes of a PNG file, for embedding.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::exporters {

// RGBA8, R in the low byte, rows from the top; written without alpha where all of it is 255. The
// image library writes files only, so a temporary one is made in `folder` and removed.
util::Result<std::vector<std::uint8_t>> encode_png(std::uint32_t width, std::uint32_t height,
                                                   std::span<const std::uint32_t> texels,
                                                   const std::string& folder);

// RGBA8 bytes as an 8-bit PNG file of 1, 3 or 4 channels, bytes as they are, no gamma.
util::Result<void> write_png(const std::string& path, std::uint32_t width, std::uint32_t height,
                             std::span<const std::uint32_t> texels, int channels);

}  // namespace octrace::exporters
