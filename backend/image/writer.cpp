#include "backend/image/writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "backend/image/file_proxy.h"

namespace octrace::image {

namespace {

// Rows handed over at once: enough for the compressor's threads, and a bound on the copy's memory.
constexpr std::uint32_t kRowsAtOnce = 256;

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
  std::vector<unsigned char> rows(
      row_bytes * std::min<std::size_t>(kRowsAtOnce, static_cast<std::size_t>(spec.height)));
  const auto height = static_cast<std::uint32_t>(spec.height);
  for (std::uint32_t begin = 0; begin < height; begin += kRowsAtOnce) {
    const std::uint32_t end = std::min(height, begin + kRowsAtOnce);
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
