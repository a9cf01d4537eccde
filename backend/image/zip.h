// Writes ZIP archives (PKWARE's APPNOTE.TXT 6.3.3), with ZIP64 records where a size, an offset or
// the number of members needs them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/output_file.h"

namespace octrace::image {

enum class Packing { stored, deflated };

class ZipWriter {
 public:
  // Sizes, offsets and counts from these on use ZIP64; readers take such records anywhere, and
  // tests set them low.
  struct Zip64From {
    std::uint64_t bytes = 0xffffffffu;
    std::uint64_t members = 0xffffu;
  };

  explicit ZipWriter(util::OutputFile& file) : ZipWriter(file, Zip64From()) {}
  ZipWriter(util::OutputFile& file, const Zip64From& zip64_from)
      : file_(file), zip64_from_(zip64_from) {}

  // The parts one after another as one member. Members have no date, so that equal content is an
  // equal archive. The name: ASCII, 65535 bytes at most.
  util::Result<void> add(std::string_view name, std::span<const std::string_view> parts,
                         Packing packing);
  util::Result<void> finish();  // the directory at the end; the caller commits the file

 private:
  struct Member {
    std::string name;
    std::uint16_t method = 0;
    std::uint32_t crc = 0;
    std::uint64_t size = 0, packed = 0, offset = 0;
  };
  util::Result<void> store(std::span<const std::string_view> parts, Member& member);
  util::Result<void> deflate(std::span<const std::string_view> parts, Member& member);

  util::OutputFile& file_;
  Zip64From zip64_from_;
  std::vector<Member> members_;
};

}  // namespace octrace::image
