#include "backend/image/npy.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <optional>
#include <string_view>

#include "backend/image/zip.h"
#include "backend/util/checked.h"
#include "backend/util/output_file.h"

namespace octrace::image {

namespace {

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie");

constexpr std::size_t kAlignment = 64;  // of the data, so that a mapped file serves SIMD

std::string_view type_of(const Array& array) {
  switch (array.type) {
    case ArrayType::float32:
      return "<f4";
    case ArrayType::uint32:
      return "<u4";
    case ArrayType::boolean:
      break;
  }
  return "|b1";
}

std::string header_of(const Array& array) {
  std::string shape;
  for (const std::uint64_t length : array.shape) shape += fmt::format("{}, ", length);
  if (array.shape.size() > 1) shape.resize(shape.size() - 2);  // "(2,)" keeps its comma
  std::string header =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", type_of(array),
                  array.shape.size() == 1 ? shape.substr(0, shape.size() - 1) : shape);
  const std::size_t prefix = 10;  // magic, version, length
  header.resize(
      (prefix + header.size() + 1 + kAlignment - 1) / kAlignment * kAlignment - prefix - 1, ' ');
  header += '\n';
  const char length[] = {static_cast<char>(header.size() & 0xff),
                         static_cast<char>(header.size() >> 8)};
  return std::string("\x93NUMPY\x01\x00", 8) + std::string(length, 2) + header;
}

std::optional<std::string_view> data_of(const Array& array) {
  std::optional<std::uint64_t> bytes = array.type == ArrayType::boolean ? 1 : 4;
  for (const std::uint64_t length : array.shape) {
    bytes = util::checked_mul(*bytes, length);
    if (!bytes) return std::nullopt;
  }
  return std::string_view(static_cast<const char*>(array.data), *bytes);
}

util::Error too_large(const std::string& path, const Array& array) {
  return {util::Exit::limit, "", fmt::format("array '{}' is too large", array.name), path, ""};
}

}  // namespace

util::Result<void> write_npy(const std::string& path, const Array& array) {
  const std::optional<std::string_view> data = data_of(array);
  if (!data) return too_large(path, array);
  util::Result<util::OutputFile> file = util::OutputFile::create(path);
  if (!file) return file.error();
  if (auto ok = file->append(header_of(array)); !ok) return ok;
  if (auto ok = file->append(*data); !ok) return ok;
  return file->commit();
}

util::Result<void> write_npz(const std::string& path, std::span<const Array> arrays,
                             Packing packing) {
  util::Result<util::OutputFile> file = util::OutputFile::create(path);
  if (!file) return file.error();
  ZipWriter zip(*file);
  for (const Array& array : arrays) {
    const std::optional<std::string_view> data = data_of(array);
    if (!data) return too_large(path, array);
    const std::string header = header_of(array);
    const std::array<std::string_view, 2> parts = {header, *data};
    if (auto ok = zip.add(array.name + ".npy", parts, packing); !ok) return ok;
  }
  if (auto ok = zip.finish(); !ok) return ok;
  return file->commit();
}

}  // namespace octrace::image
