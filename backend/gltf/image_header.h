// Which image format some bytes are, and how large, without decoding them.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "backend/util/result.h"

namespace octrace::gltf {

struct ImageHeader {
  std::string_view mime;  // image/png, image/jpeg or image/webp
  std::uint32_t width = 0, height = 0;
};

// Errors: IMAGE_UNRECOGNIZED_FORMAT, IMAGE_UNEXPECTED_EOS (the bytes end within what was
// announced), IMAGE_DATA_INVALID; without file and pointer.
util::Result<ImageHeader> read_image_header(std::span<const std::uint8_t> bytes);

}  // namespace octrace::gltf
