#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "backend/image/module_parts.h"
#include "backend/image/writer.h"

namespace octrace::image {

namespace {

double srgb_to_linear(double v) {
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

// The linear values at which the rounded sRGB byte steps from k to k + 1 (IEC 61966-2-1): a search
// among them costs a tenth of a power function and rounds the same everywhere.
std::array<float, 255> make_srgb_steps() {
  std::array<float, 255> steps{};
  for (int k = 0; k < 255; ++k) {
    steps[static_cast<std::size_t>(k)] = static_cast<float>(srgb_to_linear((k + 0.5) / 255.0));
  }
  return steps;
}

std::uint8_t srgb_byte(float linear) {
  static const std::array<float, 255> steps = make_srgb_steps();
  if (!(linear > 0.0f)) return 0;  // NaN too
  return static_cast<std::uint8_t>(std::upper_bound(steps.begin(), steps.end(), linear) -
                                   steps.begin());
}

std::uint8_t unit_byte(float value) {
  if (!(value > 0.0f)) return 0;
  return static_cast<std::uint8_t>(std::min(value, 1.0f) * 255.0f + 0.5f);
}

std::uint16_t scaled_word(float value, double scale) {
  const double word = scaled(value, scale);
  if (!(word < kBeyondScaled)) return kBeyondScaled;  // infinity and NaN too
  return static_cast<std::uint16_t>(std::max(word, 0.0));
}

float sample(const Channel& channel, std::size_t pixel) {
  float value;
  std::memcpy(&value, static_cast<const unsigned char*>(channel.data) + pixel * channel.stride, 4);
  return value;
}

std::uint32_t integer_sample(const Channel& channel, std::size_t pixel) {
  std::uint32_t value;
  std::memcpy(&value, static_cast<const unsigned char*>(channel.data) + pixel * channel.stride, 4);
  return value;
}

bool sixteen_bits(Encoding encoding) {
  return encoding == Encoding::scaled16 || encoding == Encoding::index16;
}

// Channels of the file: two would be read as grey with alpha, so a third of zeros is added.
std::size_t file_channels(const ImageView& image, bool alpha) {
  const std::size_t channels = image.channels.size();
  if (channels == 2) return 3;
  return channels == 4 && !alpha ? 3 : channels;
}

void encode_bytes(const ImageView& image, Encoding encoding, std::size_t pixel,
                  std::size_t channels, unsigned char* out) {
  float alpha = 1.0f;
  if (channels == 4) {
    alpha = std::clamp(sample(image.channels[3], pixel), 0.0f, 1.0f);
    out[3] = unit_byte(alpha);
  }
  for (std::size_t c = 0; c < std::min<std::size_t>(channels, 3); ++c) {
    const float value = c < image.channels.size() ? sample(image.channels[c], pixel) : 0.0f;
    if (encoding == Encoding::srgb8) {
      out[c] = srgb_byte(alpha > 0.0f ? value / alpha : 0.0f);
    } else {
      out[c] = unit_byte(encoding == Encoding::signed8 ? value * 0.5f + 0.5f : value);
    }
  }
}

util::Result<void> encode_words(const ImageView& image, Encoding encoding, double scale,
                                std::size_t pixel, unsigned char* out) {
  std::uint16_t word = 0;
  if (encoding == Encoding::scaled16) {
    word = scaled_word(sample(image.channels[0], pixel), scale);
  } else {
    const std::uint32_t index = integer_sample(image.channels[0], pixel);
    if (index > 65535) {
      return util::Error{util::Exit::limit, "",
                         fmt::format("{} {} does not fit the 16 bits of this format (65535); an "
                                     ".exr holds 32",
                                     image.channels[0].name, index),
                         "", ""};
    }
    word = static_cast<std::uint16_t>(index);
  }
  std::memcpy(out, &word, 2);
  return {};
}

}  // namespace

util::Result<void> write_integer_file(const std::string& path, const ImageView& image,
                                      Encoding encoding, double scale) {
  const bool words = sixteen_bits(encoding);
  const std::string format = path.substr(path.rfind('.') + 1);
  const bool jpeg = format == "jpg" || format == "jpeg";
  const std::size_t channels = words ? 1 : file_channels(image, !jpeg);
  OIIO::ImageSpec spec(static_cast<int>(image.width), static_cast<int>(image.height),
                       static_cast<int>(channels),
                       words ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::UINT8);
  // Alpha is divided out here, once, so the writer must not do it again.
  spec.attribute("oiio:UnassociatedAlpha", 1);
  const bool tiff = format == "tif" || format == "tiff";
  // OpenImageIO 2.4.7 puts a TIFF's colour space into an Exif directory that makes it unreadable.
  if (!tiff) {
    spec.attribute("oiio:ColorSpace", encoding == Encoding::srgb8 ? "sRGB" : "Linear");
  }
  if (tiff) spec.attribute("compression", "zip");
  if (jpeg) spec.attribute("compression", "jpeg:95");
  // Level 6 costs four times the time of level 1 and saves a tenth of the bytes of rendered images.
  spec.attribute("png:compressionLevel", 3);
  if (jpeg) spec.attribute("jpeg:subsampling", "4:4:4");
  spec.attribute("DateTime", "");  // as in an EXR: equal pixels, equal bytes
  std::string description;         // TIFF and JPEG keep no names of our own
  for (const auto& [name, value] : image.metadata) {
    spec.attribute(name, value);
    description += fmt::format("{}{}={}", description.empty() ? "" : "; ", name, value);
  }
  if ((tiff || jpeg) && !description.empty()) spec.attribute("ImageDescription", description);

  const std::size_t pixel_bytes = spec.pixel_bytes();
  return write_file(path, spec, [&](std::uint32_t begin, std::uint32_t end, unsigned char* out) {
    const std::size_t last = static_cast<std::size_t>(end) * image.width;
    for (std::size_t i = static_cast<std::size_t>(begin) * image.width; i < last; ++i) {
      if (words) {
        util::Result<void> encoded = encode_words(image, encoding, scale, i, out);
        if (!encoded) return encoded;
      } else {
        encode_bytes(image, encoding, i, channels, out);
      }
      out += pixel_bytes;
    }
    return util::Result<void>();
  });
}

}  // namespace octrace::image
