#include "backend/gltf/image_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

namespace octrace::gltf {
namespace {

using Bytes = std::span<const std::uint8_t>;

util::Error invalid(std::string_view code, std::string message) {
  return {util::Exit::invalid_input, std::string(code), std::move(message), "", ""};
}

util::Error truncated(std::string_view what, std::size_t needed, std::size_t size) {
  return invalid("IMAGE_UNEXPECTED_EOS",
                 fmt::format("{} needs {} bytes, the image has {}", what, needed, size));
}

util::Error broken(std::string message) {
  return invalid("IMAGE_DATA_INVALID", std::move(message));
}

bool starts_with(Bytes bytes, std::string_view text, std::size_t offset = 0) {
  if (bytes.size() < offset || bytes.size() - offset < text.size()) return false;
  return std::equal(text.begin(), text.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset),
                    [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
}

// `count` bytes at `offset`, which the caller has checked to be there.
std::uint32_t big_endian(Bytes bytes, std::size_t offset, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[offset + i];
  return value;
}

std::uint32_t little_endian(Bytes bytes, std::size_t offset, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = count; i > 0; --i) value = value << 8 | bytes[offset + i - 1];
  return value;
}

constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n";

// ISO/IEC 15948: signature, IHDR, chunks of length, type, data, CRC.
util::Result<ImageHeader> read_png(Bytes bytes) {
  constexpr std::size_t kHeader = 8, kAround = 12, kIhdr = 13;
  if (bytes.size() < kHeader + kAround + kIhdr) {
    return truncated("IHDR", kHeader + kAround + kIhdr, bytes.size());
  }
  if (big_endian(bytes, 8, 4) != kIhdr || !starts_with(bytes, "IHDR", 12)) {
    return broken("a PNG must begin with IHDR");
  }
  ImageHeader header{"image/png", big_endian(bytes, 16, 4), big_endian(bytes, 20, 4)};
  const unsigned depth = bytes[24], color = bytes[25];
  const bool valid_format =
      (color == 0 && (depth == 1 || depth == 2 || depth == 4 || depth == 8 || depth == 16)) ||
      (color == 3 && (depth == 1 || depth == 2 || depth == 4 || depth == 8)) ||
      ((color == 2 || color == 4 || color == 6) && (depth == 8 || depth == 16));
  if (!valid_format || bytes[26] != 0 || bytes[27] != 0 || bytes[28] > 1) {
    return broken(fmt::format("IHDR has colour type {} with {} bits", color, depth));
  }
  bool has_data = false;
  for (std::size_t offset = kHeader; offset < bytes.size();) {
    if (bytes.size() - offset < kAround)
      return truncated("a chunk", offset + kAround, bytes.size());
    const std::size_t length = big_endian(bytes, offset, 4);
    if (length > bytes.size() - offset - kAround) {
      return truncated("a chunk", offset + kAround + length, bytes.size());
    }
    has_data = has_data || starts_with(bytes, "IDAT", offset + 4);
    if (starts_with(bytes, "IEND", offset + 4)) break;
    offset += kAround + length;
  }
  if (!has_data) return invalid("IMAGE_UNEXPECTED_EOS", "the PNG ends before any IDAT");
  return header;
}

// ITU-T T.81, annex B: segments up to the frame header.
util::Result<ImageHeader> read_jpeg(Bytes bytes) {
  std::size_t offset = 2;
  while (true) {
    if (bytes.size() - offset < 2) return truncated("a marker", offset + 2, bytes.size());
    if (bytes[offset] != 0xff) return broken(fmt::format("needs a marker at byte {}", offset));
    const unsigned marker = bytes[offset + 1];
    if (marker == 0xff) {  // fill bytes may precede a marker
      ++offset;
      continue;
    }
    offset += 2;
    if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7)) continue;
    if (marker < 0xc0 || marker == 0xd8 || marker == 0xd9 || marker == 0xda) {
      return broken(fmt::format("marker {:02x} before the frame header", marker));
    }
    if (bytes.size() - offset < 2) return truncated("a segment", offset + 2, bytes.size());
    const std::size_t length = big_endian(bytes, offset, 2);
    if (length < 2) return broken(fmt::format("a segment of {} bytes", length));
    if (length > bytes.size() - offset) {
      return truncated("a segment", offset + length, bytes.size());
    }
    const bool is_frame = marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (!is_frame) {
      offset += length;
      continue;
    }
    if (length < 8 || length != 8 + std::size_t{3} * bytes[offset + 7] || bytes[offset + 7] == 0) {
      return broken("the frame header has the wrong length");
    }
    return ImageHeader{"image/jpeg", big_endian(bytes, offset + 5, 2),
                       big_endian(bytes, offset + 3, 2)};
  }
}

// RFC 9649.
util::Result<ImageHeader> read_webp(Bytes bytes) {
  constexpr std::size_t kEnough = 30;  // the longest of the three headers
  if (bytes.size() < 12 + 8) return truncated("RIFF", 20, bytes.size());
  const std::size_t riff = little_endian(bytes, 4, 4);
  if (riff > bytes.size() - 8) return truncated("RIFF", riff + 8, bytes.size());
  if (starts_with(bytes, "VP8L", 12)) {
    if (bytes.size() < 25) return truncated("VP8L", 25, bytes.size());
    if (bytes[20] != 0x2f) return broken("VP8L without its signature");
    const std::uint32_t bits = little_endian(bytes, 21, 4);
    return ImageHeader{"image/webp", (bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1};
  }
  if (starts_with(bytes, "VP8 ", 12)) {
    if (bytes.size() < kEnough) return truncated("VP8", kEnough, bytes.size());
    if (bytes[23] != 0x9d || bytes[24] != 0x01 || bytes[25] != 0x2a) {
      return broken("VP8 without its start code");
    }
    return ImageHeader{"image/webp", little_endian(bytes, 26, 2) & 0x3fff,
                       little_endian(bytes, 28, 2) & 0x3fff};
  }
  if (starts_with(bytes, "VP8X", 12)) {
    if (bytes.size() < kEnough) return truncated("VP8X", kEnough, bytes.size());
    return ImageHeader{"image/webp", little_endian(bytes, 24, 3) + 1,
                       little_endian(bytes, 27, 3) + 1};
  }
  return broken("a WebP without VP8, VP8L or VP8X");
}

}  // namespace

util::Result<ImageHeader> read_image_header(std::span<const std::uint8_t> bytes) {
  const auto read = [&]() -> util::Result<ImageHeader> {
    if (starts_with(bytes, kPngSignature)) return read_png(bytes);
    if (starts_with(bytes, "\xff\xd8\xff")) return read_jpeg(bytes);
    if (starts_with(bytes, "RIFF") && starts_with(bytes, "WEBP", 8)) return read_webp(bytes);
    if (bytes.size() < kPngSignature.size()) {
      return truncated("a signature", kPngSignature.size(), bytes.size());
    }
    return invalid("IMAGE_UNRECOGNIZED_FORMAT",
                   fmt::format("needs PNG, JPEG or WebP, begins with {:02x}",
                               fmt::join(bytes.first(kPngSignature.size()), " ")));
  };
  auto header = read();
  if (header && (header->width == 0 || header->height == 0)) {
    return broken(fmt::format("the image is {} x {}", header->width, header->height));
  }
  return header;
}

}  // namespace octrace::gltf
