#include "backend/gltf/glb.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace octrace::gltf {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic{'g', 'l', 'T', 'F'};
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kVersion = 2;
constexpr std::uint32_t kJson = 0x4E4F534A;
constexpr std::uint32_t kBin = 0x004E4942;

std::uint32_t little_endian_32(std::span<const std::uint8_t> bytes, std::size_t offset) {
  return static_cast<std::uint32_t>(bytes[offset]) |
         static_cast<std::uint32_t>(bytes[offset + 1]) << 8 |
         static_cast<std::uint32_t>(bytes[offset + 2]) << 16 |
         static_cast<std::uint32_t>(bytes[offset + 3]) << 24;
}

std::string_view text(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

bool has_glb_magic(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
}

GlbChunks parse_glb(std::span<const std::uint8_t> bytes, Issues& issues) {
  GlbChunks chunks;
  const auto fail = [&](std::string_view code, std::string message) {
    issues.invalid(code, "", std::move(message));
    return GlbChunks{};
  };
  if (bytes.size() >= kMagic.size() && !has_glb_magic(bytes)) {
    return fail("GLB_INVALID_MAGIC", fmt::format("needs the bytes 67 6c 54 46, has {:02x}",
                                                 fmt::join(bytes.first(kMagic.size()), " ")));
  }
  if (bytes.size() < kHeaderBytes) {
    return fail("GLB_UNEXPECTED_END_OF_HEADER",
                fmt::format("needs {} bytes, has {}", kHeaderBytes, bytes.size()));
  }
  const std::uint32_t version = little_endian_32(bytes, 4);
  if (version != kVersion) {
    return fail("GLB_INVALID_VERSION", fmt::format("needs {}, has {}", kVersion, version));
  }
  const std::size_t length = little_endian_32(bytes, 8);
  if (length < kHeaderBytes) {
    return fail("GLB_LENGTH_TOO_SMALL",
                fmt::format("needs {} or more, has {}", kHeaderBytes, length));
  }

  // Every offset stays at or below bytes.size(), so the differences below cannot wrap.
  bool first = true, second = false;
  std::size_t offset = kHeaderBytes;
  while (offset < length) {
    if (bytes.size() == offset) break;
    if (bytes.size() - offset < kChunkHeaderBytes) {
      return fail("GLB_UNEXPECTED_END_OF_CHUNK_HEADER",
                  fmt::format("needs {} bytes at {}, has {}", kChunkHeaderBytes, offset,
                              bytes.size() - offset));
    }
    const std::size_t size = little_endian_32(bytes, offset);
    const std::uint32_t type = little_endian_32(bytes, offset + 4);
    offset += kChunkHeaderBytes;
    if (first && type != kJson) {
      return fail("GLB_UNEXPECTED_FIRST_CHUNK",
                  fmt::format("needs JSON (0x4e4f534a), has 0x{:08x}", type));
    }
    if (size % 4 != 0) {
      return fail("GLB_CHUNK_LENGTH_UNALIGNED",
                  fmt::format("needs a multiple of 4, chunk 0x{:08x} has {} bytes", type, size));
    }
    const std::size_t left = length > offset ? length - offset : 0;
    if (size > left) {
      return fail("GLB_CHUNK_TOO_BIG", fmt::format("chunk 0x{:08x} needs {} bytes, {} are left in "
                                                   "the declared length of {}",
                                                   type, size, left, length));
    }
    if (size > bytes.size() - offset) {
      return fail("GLB_UNEXPECTED_END_OF_CHUNK_DATA",
                  fmt::format("chunk 0x{:08x} needs {} bytes, the file has {} more", type, size,
                              bytes.size() - offset));
    }
    if (type == kJson) {
      if (!first) return fail("GLB_DUPLICATE_CHUNK", "a second JSON chunk");
      if (size == 0) return fail("GLB_EMPTY_CHUNK", "the JSON chunk has no bytes");
      chunks.json = text(bytes.subspan(offset, size));
    } else if (type == kBin) {
      if (chunks.bin) return fail("GLB_DUPLICATE_CHUNK", "a second BIN chunk");
      if (!second) return fail("GLB_UNEXPECTED_BIN_CHUNK", "BIN must be the second chunk");
      chunks.bin = GlbChunks::Range{offset, size};
    } else {
      issues.warn("GLB_UNKNOWN_CHUNK_TYPE", "", fmt::format("chunk 0x{:08x} is ignored", type));
    }
    offset += size;
    second = first;
    first = false;
  }
  if (bytes.size() < length) {
    return fail("GLB_LENGTH_MISMATCH",
                fmt::format("declares {} bytes, the file has {}", length, bytes.size()));
  }
  if (first) return fail("GLB_UNEXPECTED_END_OF_HEADER", "needs a JSON chunk, has no chunk");
  if (bytes.size() > length) {
    issues.warn("GLB_EXTRA_DATA", "",
                fmt::format("{} bytes after the end are ignored", bytes.size() - length));
  }
  return chunks;
}

}  // namespace octrace::gltf
