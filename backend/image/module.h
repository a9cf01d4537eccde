// What the image module (liboctrace_image.so, the only part linked with OpenImageIO) offers to the
// thin library that loads it. Both are built together, so the types of image.h may cross; the
// build's version is compared all the same, because a program may find another installation's
// module.
#pragma once

#include "backend/image/image.h"

namespace octrace::image {

struct ModuleTable {
  const char* version;
  void (*set_threads)(unsigned threads);
  // Writers fill a file that exists; the caller renames it into place.
  util::Result<void> (*write_exr)(const std::string& path, const ImageView& image);
  util::Result<void> (*write_integer)(const std::string& path, const ImageView& image,
                                      Encoding encoding, double scale);
  util::Result<Image> (*read)(const std::string& path, const util::Limits& limits);
  util::Result<Rgba8> (*decode)(std::span<const std::uint8_t> bytes, const std::string& mime,
                                const util::Limits& limits);
};

inline constexpr const char* kModuleFile = "liboctrace_image.so";
inline constexpr const char* kModuleSymbol = "octrace_image_module";
using ModuleEntry = const ModuleTable* (*)();

}  // namespace octrace::image
