// By ISA-L, for ZIP archives and, through compress2(), for EXR files.
#include <isa-l/igzip_lib.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "backend/image/deflate.h"

namespace octrace::image {

namespace {

// Kept by each thread that compresses.
struct Workspace {
  isal_zstream stream;
  std::uint8_t level_buffer[ISAL_DEF_LVL1_DEFAULT];
};

isal_zstream& stream_of_thread() {
  thread_local const auto workspace = std::make_unique_for_overwrite<Workspace>();
  isal_zstream& stream = workspace->stream;
  ::isal_deflate_init(&stream);
  stream.level = 1;
  stream.level_buf = workspace->level_buffer;
  stream.level_buf_size = sizeof workspace->level_buffer;
  return stream;
}

std::uint8_t* bytes_of(const void* data) {
  return const_cast<std::uint8_t*>(static_cast<const std::uint8_t*>(data));
}

// In zlib's format. 0: does not fit.
std::size_t compress_whole(const void* from, std::size_t size, void* to, std::size_t room) {
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (size > kMost) return 0;
  isal_zstream& stream = stream_of_thread();
  stream.gzip_flag = IGZIP_ZLIB;
  stream.end_of_stream = 1;
  stream.flush = NO_FLUSH;
  stream.next_in = bytes_of(from);
  stream.avail_in = static_cast<std::uint32_t>(size);
  stream.next_out = bytes_of(to);
  stream.avail_out = static_cast<std::uint32_t>(std::min(room, kMost));
  if (::isal_deflate(&stream) != COMP_OK || stream.internal_state.state != ZSTATE_END) return 0;
  return stream.total_out;
}

int compress_by_zlib(Bytef* to, uLongf* to_size, const Bytef* from, uLong size, int level) {
  constexpr uLong kMost = std::numeric_limits<uInt>::max();
  z_stream stream{};
  if (const int begun = ::deflateInit(&stream, level); begun != Z_OK) return begun;
  stream.next_in = const_cast<Bytef*>(from);
  stream.next_out = to;
  uLong left = size, room = *to_size;
  int outcome = Z_OK;
  while (outcome == Z_OK) {
    if (stream.avail_in == 0) left -= stream.avail_in = static_cast<uInt>(std::min(left, kMost));
    if (stream.avail_out == 0) room -= stream.avail_out = static_cast<uInt>(std::min(room, kMost));
    outcome = ::deflate(&stream, left > 0 ? Z_NO_FLUSH : Z_FINISH);
  }
  *to_size = stream.total_out;
  ::deflateEnd(&stream);
  return outcome == Z_STREAM_END ? Z_OK : outcome;
}

}  // namespace

util::Result<void> deflate(std::span<const std::string_view> parts, const DeflateSink& sink) {
  isal_zstream& stream = stream_of_thread();
  std::string packed(1 << 18, '\0');
  const auto run = [&](std::string_view part, bool last) -> util::Result<void> {
    stream.next_in = bytes_of(part.data());
    stream.avail_in = static_cast<std::uint32_t>(part.size());
    stream.end_of_stream = last;
    do {
      stream.next_out = bytes_of(packed.data());
      stream.avail_out = static_cast<std::uint32_t>(packed.size());
      if (::isal_deflate(&stream) != COMP_OK) {
        return util::Error{util::Exit::internal, "", "ISA-L: compression failed", "", ""};
      }
      auto taken = sink(std::string_view(packed.data(), packed.size() - stream.avail_out));
      if (!taken) return taken;
    } while (stream.avail_out == 0);
    return {};
  };
  for (std::string_view part : parts) {
    while (!part.empty()) {
      const std::string_view piece = part.substr(0, std::size_t{1} << 30);  // avail_in is 32 bits
      if (auto ok = run(piece, false); !ok) return ok;
      part.remove_prefix(piece.size());
    }
  }
  return run({}, true);
}

}  // namespace octrace::image

// Takes the place of zlib's own in this process: OpenEXR compresses by it, offers no other way, and
// spent two thirds of the time of an EXR file there. A program's symbols come before those of the
// libraries that it loads. Only level 1, which asks for speed (exr.cpp), and only what fits.
extern "C" __attribute__((visibility("default"))) int compress2(Bytef* to, uLongf* to_size,
                                                                const Bytef* from, uLong size,
                                                                int level) {
  using namespace octrace::image;
  if (level == Z_BEST_SPEED) {
    if (const std::size_t packed = compress_whole(from, size, to, *to_size); packed > 0) {
      *to_size = packed;
      return Z_OK;
    }
  }
  return compress_by_zlib(to, to_size, from, size, level);
}
