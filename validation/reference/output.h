// Image files that another program is to write: an old one must not pass for its result.
#pragma once

#include <string>

#include "backend/image/image.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::validation {

// Removes what an earlier run left. Errors (exit 5) where it cannot.
util::Result<void> remove_output(const std::string& path);

// Reads what the program wrote. Errors (exit 5): there is no file, it is empty, it cannot be read
// as an image, its size is not the one asked for.
util::Result<image::Image> read_output(const std::string& path, std::uint32_t width,
                                       std::uint32_t height, const util::Limits& limits);

}  // namespace octrace::validation
