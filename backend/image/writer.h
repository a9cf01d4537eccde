// Opens, fills and closes an image file through OpenImageIO with every error checked.
#pragma once

#include <OpenImageIO/imageio.h>

#include <functional>
#include <string>

#include "backend/image/image.h"

namespace octrace::image {

// Fills rows [begin, end) of the file's own layout: channels interleaved, each in its own format.
using FillRows =
    std::function<util::Result<void>(std::uint32_t begin, std::uint32_t end, unsigned char* out)>;

util::Result<void> write_file(const std::string& path, const OIIO::ImageSpec& spec,
                              const FillRows& fill);

}  // namespace octrace::image
