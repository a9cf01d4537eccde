#include "backend/image/writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "backend/image/file_proxy.h"

namespace octrace::image {

namespace {

// Rows handed over at once: enough for the compressor's threads where it has several, else few, so
// that they are still in the cache when they are compressed. Multiples of an EXR's blocks of rows.
std::uint32_t rows_at_once() {
  int threads = 0;
  OIIO::getattribute("threads", threads);
  return threads == 1 ? 32 : 256;
}

util::Error write_error(const std::string& path, const FileProxy& file, const std::string& said) {
  if (file.error_number() != 0) {
    return {util::Exit::io, "IO_ERROR",
            fmt::format("cannot be written: {}", std::strerror(file.error_number())), path, ""};
  }
  return {util::Exit::io, "IO_ERROR", fmt::format("cannot be written: {}", said), path, ""};
}

}  // namespace

util::Result<void> write_file(const std::string& path, const OIIO::ImageSpec& spec,
                              const FillRows& fill) {
  // Before the output, whose destructor may write through it.
  FileProxy file(path);
  if (file.error_number() != 0) return write_error(path, file, "");
  std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path);
  if (!output) {
    return util::Error{util::Exit::unsupported, "IMAGE_FORMAT",
                       fmt::format("no writer for this kind of file: {}", OIIO::geterror()), path,
                       ""};
  }
  output->set_ioproxy(&file);
  if (!output->open(path, spec)) return write_error(path, file, output->geterror());

  const std::size_t row_bytes = spec.scanline_bytes(true);
  const auto height = static_cast<std::uint32_t>(spec.height);
  const std::uint32_t step = std::min(rows_at_once(), height);
  std::vector<unsigned char> rows(row_bytes * step);
  for (std::uint32_t begin = 0; begin < height; begin += step) {
    const std::uint32_t end = std::min(height, begin + step);
    util::Result<void> filled = fill(begin, end, rows.data());
    if (!filled) return filled;
    if (!output->write_scanlines(static_cast<int>(begin), static_cast<int>(end), 0,
                                 OIIO::TypeDesc::UNKNOWN, rows.data())) {
      return write_error(path, file, output->geterror());
    }
  }
  const bool closed = output->close();
  const std::string said = output->geterror();
  output.reset();
  file.close();
  if (!closed || file.error_number() != 0) return write_error(path, file, said);
  return {};
}

}  // namespace octrace::image
