#include "tests/unit/image_png_builder.h"

namespace octrace::test {

namespace {

void put32(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::uint8_t>(value >> shift));
}

// ISO 3309, as annex D of the PNG specification has it.
std::uint32_t crc(const Bytes& bytes, std::size_t begin) {
  std::uint32_t value = 0xffffffffu;
  for (std::size_t i = begin; i < bytes.size(); ++i) {
    value ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1u) != 0 ? 0xedb88320u : 0u);
  }
  return ~value;
}

void put_chunk(Bytes& out, const std::string& name, const Bytes& content) {
  put32(out, static_cast<std::uint32_t>(content.size()));
  const std::size_t begin = out.size();
  out.insert(out.end(), name.begin(), name.end());
  out.insert(out.end(), content.begin(), content.end());
  put32(out, crc(out, begin));
}

// One stored block: RFC 1950 and 1951 without compression.
Bytes zlib_stored(const Bytes& raw) {
  const auto size = static_cast<std::uint16_t>(raw.size());
  Bytes out = {0x78,
               0x01,
               0x01,
               static_cast<std::uint8_t>(size),
               static_cast<std::uint8_t>(size >> 8),
               static_cast<std::uint8_t>(~size),
               static_cast<std::uint8_t>(~size >> 8)};
  out.insert(out.end(), raw.begin(), raw.end());
  std::uint32_t a = 1, b = 0;
  for (const std::uint8_t byte : raw) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  put32(out, b << 16 | a);
  return out;
}

}  // namespace

Bytes make_png(const PngLayout& layout) {
  Bytes out = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes header;
  put32(header, layout.width);
  put32(header, layout.height);
  header.insert(header.end(), {layout.depth, static_cast<std::uint8_t>(layout.color), 0, 0, 0});
  put_chunk(out, "IHDR", header);
  if (layout.color_chunk == "gAMA") {
    Bytes gamma;
    put32(gamma, 100000);  // linear
    put_chunk(out, "gAMA", gamma);
  } else if (layout.color_chunk == "sRGB") {
    put_chunk(out, "sRGB", {0});
  }
  if (!layout.palette.empty()) put_chunk(out, "PLTE", layout.palette);
  if (!layout.transparency.empty()) put_chunk(out, "tRNS", layout.transparency);
  Bytes raw;
  const std::size_t row = layout.samples.size() / layout.height;
  for (std::uint32_t y = 0; y < layout.height; ++y) {
    raw.push_back(0);  // no filter
    const auto begin = layout.samples.begin() + static_cast<std::ptrdiff_t>(y * row);
    raw.insert(raw.end(), begin, begin + static_cast<std::ptrdiff_t>(row));
  }
  put_chunk(out, "IDAT", zlib_stored(raw));
  put_chunk(out, "IEND", {});
  return out;
}

}  // namespace octrace::test
