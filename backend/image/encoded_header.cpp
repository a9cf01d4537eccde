#include "backend/image/encoded_header.h"

#include <algorithm>
#include <cstring>

namespace octrace::image {

namespace {

using Bytes = std::span<const std::uint8_t>;

bool has(Bytes bytes, std::size_t offset, const char* text, std::size_t size) {
  return bytes.size() >= offset + size && std::memcmp(bytes.data() + offset, text, size) == 0;
}

std::uint32_t big16(Bytes bytes, std::size_t at) {
  return static_cast<std::uint32_t>(bytes[at]) << 8 | bytes[at + 1];
}

std::uint32_t big32(Bytes bytes, std::size_t at) {
  return big16(bytes, at) << 16 | big16(bytes, at + 2);
}

std::uint32_t little24(Bytes bytes, std::size_t at) {
  return static_cast<std::uint32_t>(bytes[at]) | static_cast<std::uint32_t>(bytes[at + 1]) << 8 |
         static_cast<std::uint32_t>(bytes[at + 2]) << 16;
}

// Chunks of length, name, content and checksum, up to IEND.
bool png_is_complete(Bytes bytes) {
  std::size_t at = 8;
  while (bytes.size() - at >= 12) {
    if (has(bytes, at + 4, "IEND", 4)) return true;
    const std::size_t length = big32(bytes, at);
    if (length > bytes.size() - at - 12) return false;
    at += length + 12;
  }
  return false;
}

std::optional<EncodedHeader> png_header(Bytes bytes) {
  if (bytes.size() < 24 || !has(bytes, 12, "IHDR", 4)) return std::nullopt;
  return EncodedHeader{EncodedFormat::png, big32(bytes, 16), big32(bytes, 20),
                       png_is_complete(bytes)};
}

// Markers with no length after them (ITU T.81, table B.1): TEM and the restart markers.
bool stands_alone(std::uint8_t marker) {
  return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
}

// SOF0 to SOF15 but for DHT (c4), JPG (c8) and DAC (cc).
bool starts_frame(std::uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<EncodedHeader> jpeg_header(Bytes bytes) {
  EncodedHeader header{EncodedFormat::jpeg, 0, 0, false};
  std::size_t at = 2;
  while (at + 4 <= bytes.size()) {
    if (bytes[at] != 0xff) return std::nullopt;
    const std::uint8_t marker = bytes[at + 1];
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    if (stands_alone(marker)) {
      at += 2;
      continue;
    }
    const std::size_t length = big16(bytes, at + 2);
    if (length < 2 || at + 2 + length > bytes.size()) return std::nullopt;
    if (starts_frame(marker)) {
      if (length < 8) return std::nullopt;
      header.height = big16(bytes, at + 5);
      header.width = big16(bytes, at + 7);
    }
    at += 2 + length;
    if (marker != 0xda) continue;
    // Within scans ff is followed by 00 or a restart marker, so the end marker cannot occur by
    // chance.
    constexpr std::uint8_t kEnd[] = {0xff, 0xd9};
    header.complete = std::search(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end(),
                                  std::begin(kEnd), std::end(kEnd)) != bytes.end();
    return header.width > 0 && header.height > 0 ? std::optional(header) : std::nullopt;
  }
  return std::nullopt;
}

// https://developers.google.com/speed/webp/docs/riff_container
std::optional<EncodedHeader> webp_header(Bytes bytes) {
  EncodedHeader header{EncodedFormat::webp, 0, 0, true};
  if (bytes.size() < 30) return std::nullopt;
  if (has(bytes, 12, "VP8X", 4)) {
    header.width = little24(bytes, 24) + 1;
    header.height = little24(bytes, 27) + 1;
  } else if (has(bytes, 12, "VP8L", 4)) {
    header.width = 1 + ((bytes[22] & 0x3fu) << 8 | bytes[21]);
    header.height = 1 + ((bytes[24] & 0x0fu) << 10 | static_cast<std::uint32_t>(bytes[23]) << 2 |
                         bytes[22] >> 6);
  } else if (has(bytes, 12, "VP8 ", 4)) {
    header.width = (bytes[27] & 0x3fu) << 8 | bytes[26];
    header.height = (bytes[29] & 0x3fu) << 8 | bytes[28];
  } else {
    return std::nullopt;
  }
  return header;
}

struct WebpChunk {
  std::size_t begin = 0, size = 0;  // the whole chunk, its header too
};

// The chunk of one frame's pixels, "VP8 " or "VP8L", that stands at the file's top level.
std::optional<WebpChunk> webp_pixels(Bytes bytes) {
  std::size_t at = 12;
  while (bytes.size() >= at + 8) {
    const std::size_t length = little24(bytes, at + 4) | static_cast<std::size_t>(bytes[at + 7])
                                                             << 24;
    const std::size_t padded = length + (length & 1u);
    if (length > bytes.size() - at - 8) return std::nullopt;
    if (has(bytes, at, "VP8", 3) && (bytes[at + 3] == ' ' || bytes[at + 3] == 'L')) {
      return WebpChunk{at, 8 + length};
    }
    if (padded > bytes.size() - at - 8) return std::nullopt;
    at += 8 + padded;
  }
  return std::nullopt;
}

}  // namespace

std::optional<EncodedHeader> read_encoded_header(Bytes bytes) {
  if (has(bytes, 0, "\x89PNG\r\n\x1a\n", 8)) return png_header(bytes);
  if (has(bytes, 0, "\xff\xd8\xff", 3)) return jpeg_header(bytes);
  if (has(bytes, 0, "RIFF", 4) && has(bytes, 8, "WEBP", 4)) return webp_header(bytes);
  return std::nullopt;
}

bool webp_is_animated(Bytes bytes) {
  return bytes.size() > 20 && has(bytes, 12, "VP8X", 4) && (bytes[20] & 0x02u) != 0;
}

std::optional<std::vector<std::uint8_t>> webp_without_alpha(Bytes bytes) {
  const std::optional<WebpChunk> chunk = webp_pixels(bytes);
  if (!chunk || chunk->size < 14) return std::nullopt;
  const bool lossless = bytes[chunk->begin + 3] == 'L';
  // Lossless: bit 28 of the header after the signature; lossy: a chunk beside the colours.
  constexpr std::uint8_t kLosslessAlpha = 0x10;
  const bool alpha = lossless ? (bytes[chunk->begin + 12] & kLosslessAlpha) != 0
                              : has(bytes, 12, "VP8X", 4) && (bytes[20] & 0x10u) != 0;
  if (!alpha) return std::nullopt;
  std::vector<std::uint8_t> out = {'R', 'I', 'F', 'F', 0, 0, 0, 0, 'W', 'E', 'B', 'P'};
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(chunk->begin);
  out.insert(out.end(), begin, begin + static_cast<std::ptrdiff_t>(chunk->size));
  if (lossless) out[12 + 12] &= static_cast<std::uint8_t>(~kLosslessAlpha);
  if (out.size() % 2 != 0) out.push_back(0);
  const std::size_t riff = out.size() - 8;
  for (std::size_t i = 0; i < 4; ++i) out[4 + i] = static_cast<std::uint8_t>(riff >> (8 * i));
  return out;
}

}  // namespace octrace::image
