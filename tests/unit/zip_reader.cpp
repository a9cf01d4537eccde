#include "tests/unit/zip_reader.h"

#include <zlib.h>

#include <stdexcept>

namespace octrace::test {

namespace {

std::uint64_t number(std::string_view bytes, std::uint64_t offset, int count) {
  if (offset + count > bytes.size()) throw std::runtime_error("read beyond the end");
  std::uint64_t value = 0;
  for (int i = count; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[offset + i]);
  return value;
}

void expect_equal(std::uint64_t a, std::uint64_t b, const char* what) {
  if (a != b) {
    throw std::runtime_error(std::string(what) + ": " + std::to_string(a) + " is not " +
                             std::to_string(b));
  }
}

std::string inflated(std::string_view packed, std::uint64_t size) {
  std::string out(size, '\0');
  z_stream stream{};
  ::inflateInit2(&stream, -15);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int status = ::inflate(&stream, Z_FINISH);
  const auto left = stream.avail_in + stream.avail_out;
  ::inflateEnd(&stream);
  if (status != Z_STREAM_END || left != 0) throw std::runtime_error("deflate stream is broken");
  return out;
}

}  // namespace

std::map<std::string, std::string> read_zip(std::string_view z) {
  const std::uint64_t end = z.size() - 22;
  expect_equal(number(z, end, 4), 0x06054b50, "end record");
  std::uint64_t count = number(z, end + 10, 2), size = number(z, end + 12, 4),
                offset = number(z, end + 16, 4);
  std::uint64_t directory_end = end;
  if (count == 0xffff || size == 0xffffffff || offset == 0xffffffff) {
    expect_equal(number(z, end - 20, 4), 0x07064b50, "ZIP64 locator");
    directory_end = number(z, end - 12, 8);
    expect_equal(number(z, directory_end, 4), 0x06064b50, "ZIP64 end record");
    expect_equal(number(z, directory_end + 4, 8), 44, "ZIP64 end record's length");
    expect_equal(directory_end + 56, end - 20, "ZIP64 end record's place");
    count = number(z, directory_end + 32, 8);
    size = number(z, directory_end + 40, 8);
    offset = number(z, directory_end + 48, 8);
  }
  expect_equal(offset + size, directory_end, "directory's end");

  std::map<std::string, std::string> members;
  std::uint64_t at = offset, data_end = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    expect_equal(number(z, at, 4), 0x02014b50, "directory entry");
    const std::uint64_t method = number(z, at + 10, 2), crc = number(z, at + 16, 4),
                        name_size = number(z, at + 28, 2), extra_size = number(z, at + 30, 2);
    std::uint64_t fields[3] = {number(z, at + 24, 4), number(z, at + 20, 4),
                               number(z, at + 42, 4)};  // size, packed size, offset
    std::uint64_t extra = at + 46 + name_size + 4;
    for (std::uint64_t& field : fields) {
      if (field != 0xffffffff) continue;
      field = number(z, extra, 8);
      extra += 8;
    }
    if (extra_size > 0) expect_equal(extra, at + 46 + name_size + extra_size, "ZIP64 field");
    const std::string name(z.substr(at + 46, name_size));
    at += 46 + name_size + extra_size;

    const std::uint64_t local = fields[2];
    expect_equal(local, data_end, "member's place");
    expect_equal(number(z, local, 4), 0x04034b50, "local header");
    expect_equal(number(z, local + 8, 2), method, "method");
    expect_equal(number(z, local + 14, 4), crc, "checksum in the local header");
    expect_equal(number(z, local + 26, 2), name_size, "name's length");
    const std::uint64_t local_extra = number(z, local + 28, 2);
    std::uint64_t packed = number(z, local + 18, 4), plain = number(z, local + 22, 4);
    if (local_extra > 0) {
      expect_equal(packed & plain, 0xffffffff, "sizes in the local header");
      plain = number(z, local + 30 + name_size + 4, 8);
      packed = number(z, local + 30 + name_size + 12, 8);
    }
    expect_equal(plain, fields[0], "size");
    expect_equal(packed, fields[1], "packed size");
    const std::uint64_t begin = local + 30 + name_size + local_extra;
    data_end = begin + packed;
    const std::string_view data = z.substr(begin, packed);
    std::string content = method == 0 ? std::string(data) : inflated(data, plain);
    expect_equal(content.size(), plain, "content's size");
    expect_equal(::crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()), crc,
                 "checksum");
    if (!members.emplace(name, std::move(content)).second) throw std::runtime_error("twice");
  }
  expect_equal(at, directory_end, "directory's length");
  expect_equal(data_end, offset, "last member's end");
  return members;
}

}  // namespace octrace::test
