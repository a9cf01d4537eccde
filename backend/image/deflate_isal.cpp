// By ISA-L, for ZIP archives and, through compress2(), for EXR files.
#include <dlfcn.h>
#include <isa-l/igzip_lib.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <string>

#include "backend/image/deflate.h"

namespace octrace::image {

namespace {

// Kept by each thread that compresses. Its first use in a thread may wait for the dynamic loader
// (TileRunner): a writer of images waits for their library anyway, and arrays alone load none.
struct Workspace {
  isal_zstream stream;
  std::uint8_t level_buffer[ISAL_DEF_LVL1_DEFAULT];
};

// Null: no memory for it.
isal_zstream* stream_of_thread() {
  thread_local std::unique_ptr<Workspace> workspace;
  if (workspace == nullptr) workspace.reset(new (std::nothrow) Workspace);
  if (workspace == nullptr) return nullptr;
  isal_zstream& stream = workspace->stream;
  ::isal_deflate_init(&stream);
  stream.level = 1;
  stream.level_buf = workspace->level_buffer;
  stream.level_buf_size = sizeof workspace->level_buffer;
  return &stream;
}

std::uint8_t* bytes_of(const void* data) {
  return const_cast<std::uint8_t*>(static_cast<const std::uint8_t*>(data));
}

// Where a stream begins, ISA-L 2.30 hashes a register that it did not set
// (igzip_icf_body_h1_gr_bt.asm, .write_first_byte), and which of two equal matches it takes later
// may depend on the address of its state. So few bytes do not get there if they are flushed, which
// costs ten bytes; what follows them is no beginning.
constexpr std::size_t kOpening = 8;

// Compresses `size` bytes, 2^32 - 1 at the most, as far as next_out has room. False: an error.
bool feed(isal_zstream& stream, const void* from, std::size_t size, int flush, bool last) {
  stream.next_in = bytes_of(from);
  stream.avail_in = static_cast<std::uint32_t>(size);
  stream.flush = static_cast<std::uint16_t>(flush);
  stream.end_of_stream = last;
  return ::isal_deflate(&stream) == COMP_OK;
}

// In zlib's format. 0: does not fit, or no memory.
std::size_t compress_whole(const Bytef* from, std::size_t size, void* to, std::size_t room) {
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  isal_zstream* const own = stream_of_thread();
  if (own == nullptr || size > kMost) return 0;
  isal_zstream& stream = *own;
  stream.gzip_flag = IGZIP_ZLIB;
  stream.next_out = bytes_of(to);
  stream.avail_out = static_cast<std::uint32_t>(std::min(room, kMost));
  const std::size_t opening = std::min(size, kOpening);
  if (!feed(stream, from, opening, SYNC_FLUSH, false) || stream.avail_in != 0 ||
      !feed(stream, from + opening, size - opening, NO_FLUSH, true) ||
      stream.internal_state.state != ZSTATE_END) {
    return 0;
  }
  return stream.total_out;
}

}  // namespace

util::Result<void> deflate(std::span<const std::string_view> parts, const DeflateSink& sink) {
  isal_zstream* const own = stream_of_thread();
  if (own == nullptr) {
    return util::Error{util::Exit::limit, "", "out of memory for compression", "", ""};
  }
  isal_zstream& stream = *own;
  const util::Error failed{util::Exit::internal, "", "ISA-L: compression failed", "", ""};
  std::string packed(1 << 18, '\0');
  const auto run = [&](std::string_view bytes, int flush, bool last) -> util::Result<void> {
    do {
      stream.next_out = bytes_of(packed.data());
      stream.avail_out = static_cast<std::uint32_t>(packed.size());
      if (!feed(stream, bytes.data(), bytes.size(), flush, last)) return failed;
      bytes.remove_prefix(bytes.size() - stream.avail_in);
      auto taken = sink(std::string_view(packed.data(), packed.size() - stream.avail_out));
      if (!taken) return taken;
    } while (stream.avail_out == 0);
    return {};
  };
  std::string opening;
  for (std::string_view part : parts) {
    if (opening.size() < kOpening) {
      const std::string_view piece = part.substr(0, kOpening - opening.size());
      opening += piece;
      part.remove_prefix(piece.size());
      if (opening.size() < kOpening) continue;
      if (auto ok = run(opening, SYNC_FLUSH, false); !ok) return ok;
    }
    while (!part.empty()) {
      const std::string_view piece = part.substr(0, std::size_t{1} << 30);  // avail_in is 32 bits
      if (auto ok = run(piece, NO_FLUSH, false); !ok) return ok;
      part.remove_prefix(piece.size());
    }
  }
  const bool few = opening.size() < kOpening;
  auto ended = run(few ? std::string_view(opening) : std::string_view(), NO_FLUSH, true);
  if (ended && stream.internal_state.state != ZSTATE_END) return failed;
  return ended;
}

}  // namespace octrace::image

// Takes the place of zlib's own in this process: OpenEXR compresses by it, offers no other way, and
// spent more than half of the time of an EXR file there. A program's symbols come before those of
// the libraries that it loads. Only level 1, which asks for speed (exr.cpp), and only what fits;
// the rest is zlib's.
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
  static const auto zlibs = reinterpret_cast<decltype(&compress2)>(::dlsym(RTLD_NEXT, "compress2"));
  return zlibs(to, to_size, from, size, level);
}
