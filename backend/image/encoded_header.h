// The header of a PNG, JPEG or WebP in memory, read without any library: sizes have to be known
// before a decoder takes memory for them, and libjpeg takes a truncated file for a grey one.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace octrace::image {

enum class EncodedFormat { png, jpeg, webp };

struct EncodedHeader {
  EncodedFormat format = EncodedFormat::png;
  std::uint32_t width = 0, height = 0;
  bool complete = true;  // the end is there (WebP: its decoder checks that)
};

// Nothing where the bytes are none of the three formats, or end within the header.
std::optional<EncodedHeader> read_encoded_header(std::span<const std::uint8_t> bytes);

// The colours of a WebP that has alpha, as a WebP without; nothing where it has none. OpenImageIO
// 2.4.7 gives a WebP's colours multiplied by alpha and no way back to them.
std::optional<std::vector<std::uint8_t>> webp_without_alpha(std::span<const std::uint8_t> bytes);
bool webp_is_animated(std::span<const std::uint8_t> bytes);

}  // namespace octrace::image
