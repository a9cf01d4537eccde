#include "validation/reference/output.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

namespace octrace::validation {

using util::Error;
using util::Exit;

util::Result<void> remove_output(const std::string& path) {
  std::error_code failure;
  std::filesystem::remove(path, failure);
  if (failure) {
    return Error{Exit::io, "", "cannot remove an old output: " + failure.message(), path, ""};
  }
  return {};
}

util::Result<image::Image> read_output(const std::string& path, std::uint32_t width,
                                       std::uint32_t height, const util::Limits& limits) {
  std::error_code failure;
  const auto size = std::filesystem::file_size(path, failure);
  if (failure) return Error{Exit::io, "", "wrote no image", path, ""};
  if (size == 0) return Error{Exit::io, "", "wrote an empty file", path, ""};
  auto image = image::read(path, limits);
  if (!image) {
    image.error().exit = Exit::io;
    return image.error();
  }
  if (image->width != width || image->height != height) {
    return Error{Exit::io, "",
                 fmt::format("the image is {}x{}, and {}x{} was asked for", image->width,
                             image->height, width, height),
                 path, ""};
  }
  return image;
}

}  // namespace octrace::validation
