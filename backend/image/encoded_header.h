// The header of a PNG, JPEG or WebP in memory, read without any library: sizes have to be known
// before a decoder takes memory for them, and libjpeg takes a truncated file for a grey one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace octrace::image {

enum class EncodedFormat { png, jpeg, webp };

struct EncodedHeader {
  EncodedFormat format = EncodedFormat::png;
  std::uint32_t width = 0, height = 0;
  bool complete = true;  // JPEG: the end marker is there; others are checked by their decoders
};

// Nothing where the bytes are none of the three formats, or end within the header.
std::optional<EncodedHeader> read_encoded_header(std::span<const std::uint8_t> bytes);

}  // namespace octrace::image
