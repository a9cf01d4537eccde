#include "backend/image/zip.h"

#include <zlib.h>

#include "backend/image/deflate.h"

namespace octrace::image {

namespace {

constexpr std::uint16_t kStored = 0, kDeflated = 8;
constexpr std::uint16_t kNeeds = 20, kNeedsZip64 = 45;  // version of the format, times ten
constexpr std::uint16_t kMadeByUnix = 3 << 8;
constexpr std::uint16_t kFirstDay = 1 << 5 | 1;  // 1 January 1980, the format's oldest
constexpr std::uint32_t kRegularFile = 0100644u << 16;

util::Error zip_error(const char* message) {
  return {util::Exit::internal, "", std::string("zip: ") + message, "", ""};
}

// Little-endian fields, one after another.
class Fields {
 public:
  Fields& u16(std::uint64_t value) { return put(value, 2); }
  Fields& u32(std::uint64_t value) { return put(value, 4); }
  Fields& u64(std::uint64_t value) { return put(value, 8); }
  Fields& text(std::string_view value) {
    bytes_.append(value);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  Fields& put(std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i) bytes_ += static_cast<char>(value >> (8 * i) & 0xff);
    return *this;
  }
  std::string bytes_;
};

std::uint32_t crc_of(std::uint32_t crc, std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

util::Result<void> ZipWriter::add(std::string_view name, std::span<const std::string_view> parts,
                                  Packing packing) {
  if (name.size() > 0xffff) return zip_error("a name is too long");
  Member member;
  member.name = name;
  member.method = packing == Packing::stored ? kStored : kDeflated;
  member.offset = file_.size();
  for (const std::string_view part : parts) member.size += part.size();
  // What does not compress grows by 5 bytes a block of 16383 or more; 1/64 bounds that amply.
  const bool wide = member.size + member.size / 64 + 64 >= zip64_from_.bytes;

  // The sizes stand before the data and are known after it.
  const auto header = [&] {
    Fields fields;
    fields.u32(0x04034b50).u16(wide ? kNeedsZip64 : kNeeds).u16(0).u16(member.method);
    fields.u16(0).u16(kFirstDay).u32(member.crc);
    fields.u32(wide ? 0xffffffffu : member.packed).u32(wide ? 0xffffffffu : member.size);
    fields.u16(name.size()).u16(wide ? 20 : 0).text(name);
    if (wide) fields.u16(1).u16(16).u64(member.size).u64(member.packed);
    return fields.bytes();
  };
  if (auto ok = file_.append(header()); !ok) return ok;
  const std::uint64_t begin = file_.size();
  auto packed = packing == Packing::stored ? store(parts, member) : deflate(parts, member);
  if (!packed) return packed;
  member.packed = file_.size() - begin;
  if (auto ok = file_.patch(member.offset, header()); !ok) return ok;
  members_.push_back(std::move(member));
  return {};
}

util::Result<void> ZipWriter::store(std::span<const std::string_view> parts, Member& member) {
  for (const std::string_view part : parts) {
    member.crc = crc_of(member.crc, part);
    if (auto ok = file_.append(part); !ok) return ok;
  }
  return {};
}

util::Result<void> ZipWriter::deflate(std::span<const std::string_view> parts, Member& member) {
  for (const std::string_view part : parts) member.crc = crc_of(member.crc, part);
  return image::deflate(parts, [this](std::string_view piece) { return file_.append(piece); });
}

util::Result<void> ZipWriter::finish() {
  const std::uint64_t begin = file_.size();
  for (const Member& member : members_) {
    // Each of the three moves to the ZIP64 field alone, in this order (APPNOTE.TXT, 4.5.3).
    Fields wide;
    const auto narrow = [&](std::uint64_t value) -> std::uint64_t {
      if (value < zip64_from_.bytes) return value;
      wide.u64(value);
      return 0xffffffffu;
    };
    const std::uint64_t size = narrow(member.size), packed = narrow(member.packed),
                        offset = narrow(member.offset);
    const std::size_t extra = wide.bytes().size();
    Fields fields;
    fields.u32(0x02014b50).u16(kMadeByUnix | kNeedsZip64).u16(extra > 0 ? kNeedsZip64 : kNeeds);
    fields.u16(0).u16(member.method).u16(0).u16(kFirstDay).u32(member.crc).u32(packed).u32(size);
    fields.u16(member.name.size()).u16(extra > 0 ? extra + 4 : 0).u16(0).u16(0).u16(0);
    fields.u32(kRegularFile).u32(offset).text(member.name);
    if (extra > 0) fields.u16(1).u16(extra).text(wide.bytes());
    if (auto ok = file_.append(fields.bytes()); !ok) return ok;
  }
  const std::uint64_t end = file_.size(), count = members_.size();
  const bool many = count >= zip64_from_.members;
  Fields tail;
  if (many || begin >= zip64_from_.bytes || end - begin >= zip64_from_.bytes) {
    tail.u32(0x06064b50).u64(44).u16(kMadeByUnix | kNeedsZip64).u16(kNeedsZip64).u32(0).u32(0);
    tail.u64(count).u64(count).u64(end - begin).u64(begin);
    tail.u32(0x07064b50).u32(0).u64(end).u32(1);
  }
  const auto narrow = [&](std::uint64_t value) -> std::uint64_t {
    return value < zip64_from_.bytes ? value : 0xffffffffu;
  };
  tail.u32(0x06054b50).u16(0).u16(0).u16(many ? 0xffff : count).u16(many ? 0xffff : count);
  tail.u32(narrow(end - begin)).u32(narrow(begin)).u16(0);
  return file_.append(tail.bytes());
}

}  // namespace octrace::image
