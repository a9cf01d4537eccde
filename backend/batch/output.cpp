#include "backend/batch/output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "backend/batch/array_output.h"
#include "backend/batch/camera_choice.h"
#include "backend/util/atomic_file.h"
#include "backend/util/version.h"

namespace octrace::batch {

namespace {

using kernels::Aov;

std::optional<FileKind> kind_of(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".exr") return FileKind::exr;
  if (extension == ".png") return FileKind::png;
  if (extension == ".tif" || extension == ".tiff") return FileKind::tiff;
  if (extension == ".jpg" || extension == ".jpeg") return FileKind::jpeg;
  if (extension == ".npy") return FileKind::npy;
  if (extension == ".npz") return FileKind::npz;
  return std::nullopt;
}

bool holds_many(FileKind kind) { return kind == FileKind::exr || kind == FileKind::npz; }

bool is_array(FileKind kind) { return kind == FileKind::npy || kind == FileKind::npz; }

// Nothing for positions and motion, whose values no integer format holds.
std::optional<image::Encoding> encoding_of(Aov aov) {
  switch (aov) {
    case Aov::beauty:
    case Aov::albedo:
      return image::Encoding::srgb8;
    case Aov::depth:
    case Aov::distance:
      return image::Encoding::scaled16;
    case Aov::normal:
    case Aov::geometric_normal:
      return image::Encoding::signed8;
    case Aov::uv:
    case Aov::barycentric:
    case Aov::mask:
      return image::Encoding::linear8;
    case Aov::object_id:
    case Aov::material_id:
    case Aov::primitive_id:
      return image::Encoding::index16;
    case Aov::position:
    case Aov::motion:
      break;
  }
  return std::nullopt;
}

Aov only_aov(const render::AovSet& set) {
  for (const render::AovInfo& info : render::aov_table()) {
    if (set.test(static_cast<std::size_t>(info.aov))) return info.aov;
  }
  return Aov::beauty;
}

render::AovSet beauty_only() {
  render::AovSet set;
  set.set(static_cast<std::size_t>(Aov::beauty));
  return set;
}

util::Result<void> check_single_output(const Output& output, const ImageSize& size) {
  if (output.aovs.count() != 1) {
    return usage_error(
        fmt::format("this format holds one AOV, {} were named", output.aovs.count()));
  }
  if (output.kind == FileKind::npy) return {};
  const render::AovInfo& info = render::aov_info(only_aov(output.aovs));
  const std::optional<image::Encoding> encoding = encoding_of(info.aov);
  if (!encoding) {
    return usage_error(fmt::format("{} needs floating point: use .exr or .npy", info.option));
  }
  const bool words =
      *encoding == image::Encoding::scaled16 || *encoding == image::Encoding::index16;
  if (output.kind == FileKind::jpeg && words) {
    return usage_error(
        fmt::format("{} needs 16 bits, a JPEG has 8: use .exr, .png or .tif", info.option));
  }
  const std::uint32_t longest = std::max(size.width, size.height);
  const std::uint32_t allowed = output.kind == FileKind::jpeg ? 65500 : 1000000;
  if (longest > allowed) {
    return usage_error(fmt::format("{}x{} pixels, this format takes {} a side: use .exr",
                                   size.width, size.height, allowed));
  }
  return {};
}

struct Argument {
  std::string path;
  std::optional<std::string> aovs;
};

Argument split_argument(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || text.find_first_of("./", colon) != std::string::npos) {
    return {text, std::nullopt};
  }
  return {text.substr(0, colon), text.substr(colon + 1)};
}

util::Result<Output> plan_output(const std::string& argument, const render::AovSet& listed,
                                 const ImageSize& size) {
  const Argument split = split_argument(argument);
  std::optional<render::AovSet> named;
  if (split.aovs) {
    util::Result<render::AovSet> parsed = render::parse_aovs(*split.aovs);
    if (!parsed) return parsed.error();
    named = *parsed;
  }
  util::Result<Output> output = plan_file(split.path, named, listed, size);
  if (!output) {
    output.error().message = fmt::format("-o {}: {}", argument, output.error().message);
  }
  return output;
}

void add_channels(const render::Framebuffer& framebuffer, Aov aov, image::ImageView& view) {
  const render::AovInfo& info = render::aov_info(aov);
  const auto count = static_cast<std::size_t>(info.channel_count);
  const auto* data = info.uint32
                         ? reinterpret_cast<const unsigned char*>(framebuffer.uints(aov).data())
                         : reinterpret_cast<const unsigned char*>(framebuffer.floats(aov).data());
  for (std::size_t c = 0; c < count; ++c) {
    view.channels.push_back({std::string(info.channels[c]),
                             info.uint32 ? image::SampleType::uint32 : image::SampleType::float32,
                             data + c * 4, count * 4});
  }
}

}  // namespace

util::Error usage_error(const std::string& message) {
  return {util::Exit::usage, "", message, "", ""};
}

util::Result<Output> plan_file(const std::string& path, const std::optional<render::AovSet>& named,
                               const render::AovSet& listed, const ImageSize& size) {
  const std::optional<FileKind> kind = kind_of(path);
  if (!kind) {
    return usage_error("the name must end in .exr, .png, .tif, .jpg, .npy or .npz");
  }
  Output output{path, *kind, named.value_or(listed)};
  if (!named && !holds_many(*kind) && listed.count() != 1) output.aovs = beauty_only();
  if (!holds_many(*kind)) {
    util::Result<void> checked = check_single_output(output, size);
    if (!checked) return checked.error();
  }
  return output;
}

util::Result<std::vector<Output>> plan_outputs(const std::vector<std::string>& arguments,
                                               const std::optional<std::string>& aov_list,
                                               const ImageSize& size) {
  render::AovSet listed = beauty_only();
  if (aov_list) {
    util::Result<render::AovSet> parsed = render::parse_aovs(*aov_list);
    if (!parsed) return parsed.error();
    listed = *parsed;
  }
  std::vector<Output> outputs;
  std::set<std::filesystem::path> seen;
  for (const std::string& argument : arguments) {
    util::Result<Output> output = plan_output(argument, listed, size);
    if (!output) return output.error();
    if (!seen.insert(std::filesystem::path(output->path).lexically_normal()).second) {
      return usage_error(fmt::format("-o {}: this file is named twice", output->path));
    }
    outputs.push_back(std::move(*output));
  }
  const render::AovSet homeless = aov_list ? listed & ~needed_aovs(outputs) : render::AovSet();
  if (homeless.any()) {
    return usage_error(fmt::format(
        "--aov asks for {}, and no -o holds it: add an .exr or .npz, or name it as in -o "
        "FILE.png:{}",
        render::aov_info(only_aov(homeless)).option, render::aov_info(only_aov(homeless)).option));
  }
  return outputs;
}

render::AovSet needed_aovs(const std::vector<Output>& outputs) {
  render::AovSet needed;
  for (const Output& output : outputs) needed |= output.aovs;
  return needed;
}

bool needs_textures(const render::AovSet& aovs) {
  for (const Aov aov : {Aov::beauty, Aov::albedo, Aov::normal}) {
    if (aovs.test(static_cast<std::size_t>(aov))) return true;
  }
  return false;
}

Metadata view_metadata(const std::string& scene_source, const scene::Camera& camera) {
  return {{"octrace:version", util::version()},
          {"octrace:scene", scene_source},
          {"octrace:camera", camera_json(camera)}};
}

bool needs_image_library(const std::vector<Output>& outputs) {
  return std::any_of(outputs.begin(), outputs.end(),
                     [](const Output& output) { return !is_array(output.kind); });
}

util::Result<void> check_writable(const std::string& path) {
  util::Result<util::AtomicFile> probe = util::AtomicFile::create(path);
  if (!probe) return probe.error();
  return {};
}

std::optional<std::string> depth_warning(const Output& output,
                                         const render::Framebuffer& framebuffer,
                                         double depth_scale) {
  if (output.kind == FileKind::exr || is_array(output.kind)) return std::nullopt;
  const Aov aov = only_aov(output.aovs);
  if (encoding_of(aov) != image::Encoding::scaled16) return std::nullopt;
  std::uint64_t hits = 0, lost = 0;
  for (const float value : framebuffer.floats(aov)) {
    if (!std::isfinite(value)) continue;
    ++hits;
    lost += !(image::scaled(value, depth_scale) < image::kBeyondScaled);
  }
  if (lost == 0) return std::nullopt;
  return fmt::format(
      "{}: {} of {} pixels that show something lie beyond {:.6g}, where 16 bits end at a depth "
      "scale of {:g}, and read {}, as the background does; a smaller scale reaches further",
      output.path, lost, hits, (image::kBeyondScaled - 1) / depth_scale, depth_scale,
      image::kBeyondScaled);
}

util::Result<void> write_output(const Output& output, const render::Framebuffer& framebuffer,
                                double depth_scale, const Metadata& metadata) {
  if (is_array(output.kind)) {
    return write_arrays(output.path, output.kind == FileKind::npz, framebuffer, output.aovs);
  }
  image::ImageView view{framebuffer.width(), framebuffer.height(), {}, metadata};
  for (const render::AovInfo& info : render::aov_table()) {
    if (output.aovs.test(static_cast<std::size_t>(info.aov))) {
      add_channels(framebuffer, info.aov, view);
    }
  }
  if (output.kind == FileKind::exr) return image::write_exr(output.path, view);
  const Aov aov = only_aov(output.aovs);
  const image::Encoding encoding = *encoding_of(aov);
  if (encoding == image::Encoding::scaled16) {
    view.metadata.emplace_back("octrace:depth_scale", fmt::format("{}", depth_scale));
  }
  return image::write_integer(output.path, view, encoding, depth_scale);
}

}  // namespace octrace::batch
