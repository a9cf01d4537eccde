#include "exporters/png.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "backend/image/image.h"

namespace octrace::exporters {

util::Result<void> write_png(const std::string& path, std::uint32_t width, std::uint32_t height,
                             std::span<const std::uint32_t> texels, int channels) {
  static constexpr const char* kNames[] = {"R", "G", "B", "A"};
  const auto stride = static_cast<std::size_t>(channels);
  std::vector<float> samples(texels.size() * stride);
  for (std::size_t i = 0; i < texels.size(); ++i) {
    for (std::size_t c = 0; c < stride; ++c) {
      samples[i * stride + c] = static_cast<float>((texels[i] >> (8 * c)) & 0xffu) / 255.0f;
    }
  }
  image::ImageView view;
  view.width = width;
  view.height = height;
  for (std::size_t c = 0; c < stride; ++c) {
    view.channels.push_back({channels == 1 ? "Y" : kNames[c], image::SampleType::float32,
                             samples.data() + c, sizeof(float) * stride});
  }
  // A colour space would be written into the file as a gamma, and readers would apply it.
  view.metadata.emplace_back("oiio:ColorSpace", "");
  return image::write_integer(path, view, image::Encoding::linear8, 1.0);
}

util::Result<std::vector<std::uint8_t>> encode_png(std::uint32_t width, std::uint32_t height,
                                                   std::span<const std::uint32_t> texels,
                                                   const std::string& folder) {
  const bool opaque =
      std::all_of(texels.begin(), texels.end(), [](std::uint32_t t) { return t >> 24 == 255; });
  const std::string path = fmt::format("{}.octrace-texture-{}.png", folder, ::getpid());
  if (auto written = write_png(path, width, height, texels, opaque ? 3 : 4); !written) {
    return written.error();
  }
  std::ifstream file(path, std::ios::binary);
  std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file),
                                  std::istreambuf_iterator<char>()};
  const bool complete = file.good() || file.eof();
  file.close();
  ::unlink(path.c_str());
  if (!complete || bytes.empty()) {
    return util::Error{util::Exit::io, "IO_ERROR", "cannot be read back", path, ""};
  }
  return bytes;
}

}  // namespace octrace::exporters
