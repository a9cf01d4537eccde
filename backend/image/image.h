// Reading and writing image files. The library behind it (OpenImageIO) loads when first needed, on
// whatever thread calls preload(), because its shared libraries take longer to load than many
// scenes take to render.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::image {

enum class SampleType { float32, uint32 };

// One channel of an image in memory: sample (x, y) lies at data + (y * width + x) * stride bytes.
struct Channel {
  std::string name;
  SampleType type = SampleType::float32;
  const void* data = nullptr;
  std::size_t stride = 4;
};

struct ImageView {
  std::uint32_t width = 0, height = 0;
  std::vector<Channel> channels;
  std::vector<std::pair<std::string, std::string>> metadata;
};

// A file as read: channels in file order, each converted to float32 or uint32.
struct Image {
  std::uint32_t width = 0, height = 0;
  struct Plane {
    std::string name;
    SampleType type = SampleType::float32;
    std::vector<float> floats;         // float32
    std::vector<std::uint32_t> uints;  // uint32
  };
  std::vector<Plane> planes;
  std::vector<std::pair<std::string, std::string>> metadata;
  const Plane* find(const std::string& name) const;
};

// How samples become the integers of a PNG, TIFF or JPEG.
enum class Encoding {
  srgb8,     // beauty, albedo: linear to sRGB; alpha unassociated in PNG
  linear8,   // mask
  signed8,   // normals: [-1, 1] to [0, 255]
  scaled16,  // depth: round(value * scale), 65535 where it does not fit or nothing was hit
  index16,   // ids: as they are; an error where one exceeds 65535
};

// What scaled16 writes: 65535 in place of what is that or more, or is no number.
inline constexpr std::uint16_t kBeyondScaled = 65535;
inline double scaled(float value, double scale) {
  return std::floor(static_cast<double>(value) * scale + 0.5);
}

void preload();  // starts loading the image library in the background; optional
// Returns when a preload() that was begun has ended: a process must not run its exit handlers
// before.
void finish_preload();
// The library's own threads, which compress and decompress (0: all cores). Waits for its loading.
util::Result<void> set_threads(unsigned threads);
// The same without waiting: they are set before the first image is read or written. Not beside
// other calls: the library's threads cannot be changed while it is used.
void request_threads(unsigned threads);

// Every writer: the file is whole or absent (temporary name in the same folder, flushed, renamed).
util::Result<void> write_exr(const std::string& path, const ImageView& image);
util::Result<void> write_integer(const std::string& path, const ImageView& image, Encoding encoding,
                                 double scale);
util::Result<Image> read(const std::string& path, const util::Limits& limits);

// RGBA8 from a PNG, JPEG or WebP in memory; rows from the top, alpha as stored (unassociated).
struct Rgba8 {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint32_t> texels;
};
util::Result<Rgba8> decode(std::span<const std::uint8_t> bytes, const std::string& mime,
                           const util::Limits& limits);

}  // namespace octrace::image
