#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <memory>
#include <new>

#include "backend/image/encoded_header.h"
#include "backend/image/module_parts.h"

namespace octrace::image {

namespace {

util::Error invalid(const std::string& message) {
  return {util::Exit::invalid_input, "IMAGE_DATA_INVALID", message, "", ""};
}

const char* reader_name(EncodedFormat format) {
  switch (format) {
    case EncodedFormat::png:
      return "png";
    case EncodedFormat::jpeg:
      return "jpeg";
    case EncodedFormat::webp:
      return "webp";
  }
  return "";
}

std::uint32_t pack(const unsigned char* pixel, int channels) {
  const std::uint32_t r = pixel[0];
  const std::uint32_t g = channels >= 3 ? pixel[1] : r;
  const std::uint32_t b = channels >= 3 ? pixel[2] : r;
  const std::uint32_t a = channels == 4 ? pixel[3] : channels == 2 ? pixel[1] : 255u;
  return r | g << 8 | b << 16 | a << 24;
}

util::Result<Rgba8> decode_with_library(std::span<const std::uint8_t> bytes,
                                        const EncodedHeader& header) {
  OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
  const char* name = reader_name(header.format);
  std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(name);
  if (!input) {
    return util::Error{util::Exit::unsupported, "IMAGE_FORMAT",
                       fmt::format("the image library cannot read {}", name), "", ""};
  }
  OIIO::ImageSpec config, spec;
  config.attribute("oiio:UnassociatedAlpha", 1);  // glTF's alpha does not scale the colours
  input->set_ioproxy(&memory);
  if (!input->open(std::string("memory.") + name, spec, config)) return invalid(input->geterror());
  if (spec.width != static_cast<int>(header.width) ||
      spec.height != static_cast<int>(header.height) || spec.nchannels < 1 || spec.nchannels > 4) {
    return invalid(fmt::format("{}x{} pixels of {} channels, the header says {}x{}", spec.width,
                               spec.height, spec.nchannels, header.width, header.height));
  }
  const std::size_t pixels = static_cast<std::size_t>(header.width) * header.height;
  const int channels = spec.nchannels;
  std::vector<unsigned char> samples(pixels * static_cast<std::size_t>(channels));
  if (!input->read_image(0, 0, 0, channels, OIIO::TypeDesc::UINT8, samples.data())) {
    return invalid(input->geterror());
  }
  Rgba8 image{header.width, header.height, std::vector<std::uint32_t>(pixels)};
  for (std::size_t i = 0; i < pixels; ++i) {
    image.texels[i] = pack(samples.data() + i * static_cast<std::size_t>(channels), channels);
  }
  return image;
}

// Colours and alpha separately, so that the colours are those of the file.
util::Result<Rgba8> decode_webp(std::span<const std::uint8_t> bytes, const EncodedHeader& header) {
  if (webp_is_animated(bytes)) {
    return util::Error{util::Exit::unsupported, "", "an animated WebP is no texture", "", ""};
  }
  util::Result<Rgba8> image = decode_with_library(bytes, header);
  const std::optional<std::vector<std::uint8_t>> opaque = webp_without_alpha(bytes);
  if (!image || !opaque) return image;
  const util::Result<Rgba8> colors = decode_with_library(*opaque, header);
  if (!colors) return colors;
  for (std::size_t i = 0; i < image->texels.size(); ++i) {
    image->texels[i] = (image->texels[i] & 0xff000000u) | (colors->texels[i] & 0x00ffffffu);
  }
  return image;
}

}  // namespace

util::Result<Rgba8> decode_memory(std::span<const std::uint8_t> bytes, const std::string& mime,
                                  const util::Limits& limits) {
  const std::optional<EncodedHeader> header = read_encoded_header(bytes);
  if (!header) return invalid(fmt::format("no header of a PNG, JPEG or WebP ({})", mime));
  if (header->width == 0 || header->height == 0) return invalid("an image of no pixels");
  const std::uint64_t pixels = static_cast<std::uint64_t>(header->width) * header->height;
  if (pixels > limits.max_texture_pixels) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("{}x{} pixels, --max-texture-pixels allows {}", header->width,
                                   header->height, limits.max_texture_pixels),
                       "", ""};
  }
  if (!header->complete) {
    return util::Error{util::Exit::invalid_input, "IMAGE_UNEXPECTED_EOS",
                       fmt::format("the {} ends early", mime), "", ""};
  }
  try {
    return header->format == EncodedFormat::webp ? decode_webp(bytes, *header)
                                                 : decode_with_library(bytes, *header);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& exception) {  // from a decoder, about its input
    return invalid(exception.what());
  }
}

}  // namespace octrace::image
