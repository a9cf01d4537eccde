#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <memory>
#include <new>

#include "backend/image/module_parts.h"

namespace octrace::image {

namespace {

constexpr std::uint32_t kRowsAtOnce = 256;

util::Error invalid(const std::string& path, const std::string& message) {
  return {util::Exit::invalid_input, "IMAGE_DATA_INVALID", message, path, ""};
}

void read_metadata(const OIIO::ImageSpec& spec, Image& image) {
  for (const OIIO::ParamValue& attribute : spec.extra_attribs) {
    image.metadata.emplace_back(attribute.name().string(), attribute.get_string());
  }
}

// UINT planes are read as they are: converting them would scale them to [0, 1].
util::Result<Image> read_planes(OIIO::ImageInput& input, const OIIO::ImageSpec& spec,
                                const std::string& path) {
  Image image;
  image.width = static_cast<std::uint32_t>(spec.width);
  image.height = static_cast<std::uint32_t>(spec.height);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  const auto channels = static_cast<std::size_t>(spec.nchannels);
  for (std::size_t c = 0; c < channels; ++c) {
    Image::Plane plane;
    plane.name = spec.channelnames[c];
    if (spec.channelformat(static_cast<int>(c)) == OIIO::TypeDesc::UINT32) {
      plane.type = SampleType::uint32;
      plane.uints.resize(pixels);
    } else {
      plane.floats.resize(pixels);
    }
    image.planes.push_back(std::move(plane));
  }
  const std::size_t pixel_bytes = spec.pixel_bytes(true);
  std::vector<unsigned char> native(pixel_bytes * image.width *
                                    std::min<std::size_t>(kRowsAtOnce, image.height));
  for (std::uint32_t begin = 0; begin < image.height; begin += kRowsAtOnce) {
    const std::uint32_t end = std::min(image.height, begin + kRowsAtOnce);
    if (!input.read_scanlines(0, 0, spec.y + static_cast<int>(begin),
                              spec.y + static_cast<int>(end), spec.z, 0, spec.nchannels,
                              OIIO::TypeDesc::UNKNOWN, native.data())) {
      return invalid(path, input.geterror());
    }
    const std::size_t first = static_cast<std::size_t>(begin) * image.width;
    const std::size_t count = static_cast<std::size_t>(end - begin) * image.width;
    const unsigned char* in = native.data();
    for (std::size_t c = 0; c < channels; ++c) {
      const OIIO::TypeDesc type = spec.channelformat(static_cast<int>(c));
      Image::Plane& plane = image.planes[c];
      const bool whole = plane.type == SampleType::uint32;
      void* out = whole ? static_cast<void*>(plane.uints.data() + first)
                        : static_cast<void*>(plane.floats.data() + first);
      OIIO::convert_image(1, static_cast<int>(count), 1, 1, in, type,
                          static_cast<OIIO::stride_t>(pixel_bytes), OIIO::AutoStride,
                          OIIO::AutoStride, out,
                          whole ? OIIO::TypeDesc::UINT32 : OIIO::TypeDesc::FLOAT, 4,
                          OIIO::AutoStride, OIIO::AutoStride);
      in += type.size();
    }
  }
  read_metadata(spec, image);
  return image;
}

util::Result<Image> read_with_library(const std::string& path, const std::string& reader,
                                      const util::Limits& limits) {
  std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(reader);
  if (!input) {
    return util::Error{util::Exit::unsupported, "IMAGE_FORMAT",
                       fmt::format("the image library cannot read {}", reader), path, ""};
  }
  OIIO::ImageSpec config, spec;
  config.attribute("oiio:UnassociatedAlpha", 1);
  if (!input->open(path, spec, config)) return invalid(path, input->geterror());
  if (spec.width <= 0 || spec.height <= 0 || spec.depth != 1 || spec.nchannels < 1) {
    return invalid(path, "an image of no pixels, or of three dimensions");
  }
  if (spec.tile_width != 0) {
    return util::Error{util::Exit::unsupported, "IMAGE_FORMAT", "tiled images are not read", path,
                       ""};
  }
  const std::uint64_t pixels =
      static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height);
  if (pixels > limits.max_image_pixels) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("{}x{} pixels, --max-image-pixels allows {}", spec.width,
                                   spec.height, limits.max_image_pixels),
                       path, ""};
  }
  return read_planes(*input, spec, path);
}

}  // namespace

util::Result<Image> read_file(const std::string& path, const util::Limits& limits) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return util::Error{util::Exit::io, "IO_ERROR",
                       error ? error.message() : "is not a regular file", path, ""};
  }
  const std::string extension = std::filesystem::path(path).extension().string();
  for (const char* known : {".exr", ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp"}) {
    if (extension != known) continue;
    try {
      return read_with_library(path, extension.substr(1), limits);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& exception) {
      return invalid(path, exception.what());
    }
  }
  return util::Error{util::Exit::unsupported, "IMAGE_FORMAT",
                     fmt::format("\"{}\" is none of .exr .png .tif .jpg .webp", extension), path,
                     ""};
}

}  // namespace octrace::image
