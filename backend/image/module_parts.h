// The module's functions, one file each.
#pragma once

#include "backend/image/image.h"

namespace octrace::image {

util::Result<void> write_exr_file(const std::string& path, const ImageView& image);
util::Result<void> write_integer_file(const std::string& path, const ImageView& image,
                                      Encoding encoding, double scale);
util::Result<Image> read_file(const std::string& path, const util::Limits& limits);
util::Result<Rgba8> decode_memory(std::span<const std::uint8_t> bytes, const std::string& mime,
                                  const util::Limits& limits);

}  // namespace octrace::image
