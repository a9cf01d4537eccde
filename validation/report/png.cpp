#include "validation/report/png.h"

#include <zlib.h>

#include <new>

namespace octrace::validation {
namespace {

void append_big_endian(std::string& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<char>(value >> shift));
}

void append_chunk(std::string& out, std::string_view type, std::string_view data) {
  append_big_endian(out, static_cast<std::uint32_t>(data.size()));
  std::string body(type);
  body += data;
  out += body;
  append_big_endian(out,
                    static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()),
                                                     static_cast<uInt>(body.size()))));
}

std::string deflated(const std::string& raw) {
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::string out(size, '\0');
  // zlib fails here only for want of memory: the buffer is as large as it can need.
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size,
                reinterpret_cast<const Bytef*>(raw.data()), static_cast<uLong>(raw.size()),
                Z_BEST_COMPRESSION) != Z_OK) {
    throw std::bad_alloc();
  }
  out.resize(size);
  return out;
}

enum ColorType : char { kTrueColor = 2, kIndexed = 3 };

std::string assemble(std::uint32_t width, std::uint32_t height, int bits, ColorType type,
                     const std::string& palette, const std::string& scanlines) {
  std::string out("\x89PNG\r\n\x1a\n", 8);
  std::string header;
  append_big_endian(header, width);
  append_big_endian(header, height);
  header.push_back(static_cast<char>(bits));
  header.push_back(type);
  header.append(3, '\0');  // deflate, the standard filters, not interlaced
  append_chunk(out, "IHDR", header);
  if (!palette.empty()) append_chunk(out, "PLTE", palette);
  append_chunk(out, "IDAT", deflated(scanlines));
  append_chunk(out, "IEND", "");
  return out;
}

}  // namespace

std::string encode_palette_png(std::uint32_t width, std::uint32_t height,
                               std::span<const std::uint8_t> indices,
                               std::span<const Rgb> palette) {
  const int bits = palette.size() <= 2 ? 1 : palette.size() <= 4 ? 2 : palette.size() <= 16 ? 4 : 8;
  const std::uint32_t per_byte = 8u / static_cast<std::uint32_t>(bits);
  std::string scanlines;
  scanlines.reserve(std::size_t{height} * (width / per_byte + 2));
  for (std::uint32_t y = 0; y < height; ++y) {
    scanlines.push_back('\0');  // no filter: the specification's advice for palettes
    for (std::uint32_t x = 0; x < width; x += per_byte) {
      unsigned packed = 0;
      for (std::uint32_t k = 0; k < per_byte; ++k) {
        const unsigned index = x + k < width ? indices[std::size_t{y} * width + x + k] : 0u;
        packed = packed << bits | index;
      }
      scanlines.push_back(static_cast<char>(packed));
    }
  }
  std::string colors;
  for (const Rgb& color : palette) colors.append(color.begin(), color.end());
  return assemble(width, height, bits, kIndexed, colors, scanlines);
}

std::string encode_rgb_png(std::uint32_t width, std::uint32_t height,
                           std::span<const std::uint8_t> samples) {
  std::string scanlines;
  scanlines.reserve(std::size_t{height} * (3 * std::size_t{width} + 1));
  for (std::uint32_t y = 0; y < height; ++y) {
    const std::uint8_t* line = samples.data() + std::size_t{y} * width * 3;
    scanlines.push_back('\1');  // filter Sub: each byte less that of the pixel on its left
    for (std::uint32_t i = 0; i < 3 * width; ++i) {
      scanlines.push_back(static_cast<char>(line[i] - (i < 3 ? 0 : line[i - 3])));
    }
  }
  return assemble(width, height, 8, kTrueColor, "", scanlines);
}

std::string base64(std::string_view bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out.push_back(i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63u]);
    }
  }
  return out;
}

}  // namespace octrace::validation
