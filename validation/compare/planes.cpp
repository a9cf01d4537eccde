#include "validation/compare/planes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

namespace octrace::validation {
namespace {

using util::Error;
using util::Exit;
using util::Result;
using Plane = image::Image::Plane;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Blender writes 1e10 behind everything; no scene reaches it (scene::kMaxCoordinate is 1e9).
constexpr std::uint32_t kHalf = 1u << 15;  // POV-Ray: the depth is in two halves of 15 bits
constexpr float kBackground = 9.9e9f;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// `wanted` is a whole channel name or, with a leading dot, the end of one: Blender puts the name of
// the scene's view layer first.
bool matches(const std::string& name, const std::string& wanted) {
  const std::string channel = lower(name);
  return wanted[0] == '.' ? channel.ends_with(wanted) : channel == wanted;
}

const Plane* find(const image::Image& image, std::initializer_list<const char*> wanted) {
  for (const char* name : wanted) {
    for (const Plane& plane : image.planes) {
      if (matches(plane.name, name)) return &plane;
    }
  }
  return nullptr;
}

float sample(const Plane& plane, std::size_t i) {
  return plane.type == image::SampleType::float32 ? plane.floats[i]
                                                  : static_cast<float>(plane.uints[i]);
}

Error invalid(const std::string& file, std::string message) {
  return {Exit::invalid_input, "", std::move(message), file, ""};
}

Result<void> check(const image::Image& image, const std::string& file) {
  if (image.width == 0 || image.height == 0) return invalid(file, "the image has no pixels");
  const std::size_t pixels = std::size_t{image.width} * image.height;
  for (const Plane& plane : image.planes) {
    const std::size_t count =
        plane.type == image::SampleType::float32 ? plane.floats.size() : plane.uints.size();
    if (count != pixels) {
      return invalid(file, fmt::format("channel {} has {} samples, the image {} pixels", plane.name,
                                       count, pixels));
    }
  }
  return {};
}

Result<std::vector<float>> finite_plane(const Plane& plane, std::size_t pixels,
                                        const image::Image& image, const std::string& file) {
  std::vector<float> values(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    values[i] = sample(plane, i);
    if (std::isnan(values[i])) {
      return invalid(file, fmt::format("channel {} is not a number at pixel ({}, {})", plane.name,
                                       i % image.width, i / image.width));
    }
  }
  return values;
}

std::string channel_list(const image::Image& image) {
  std::string list;
  for (const Plane& plane : image.planes) list += (list.empty() ? "" : ", ") + plane.name;
  return list.empty() ? "none" : list;
}

}  // namespace

Result<Planes> planes_from_image(const image::Image& image, const std::string& file) {
  if (auto checked = check(image, file); !checked) return checked.error();
  const std::size_t pixels = std::size_t{image.width} * image.height;
  const Plane* depth = find(image, {"z", ".depth.z", "depth", "depth.z", "depth.v", "depth.y"});
  const Plane* mask = find(image, {"mask"});
  if (!mask) mask = find(image, {"a", ".combined.a", "alpha"});
  const Plane* id = find(image, {"object_id", ".indexob.x"});
  const Plane* rgb[3] = {find(image, {"r", ".combined.r"}), find(image, {"g", ".combined.g"}),
                         find(image, {"b", ".combined.b"})};
  const bool has_rgb = rgb[0] && rgb[1] && rgb[2];
  if (!depth && !mask && !has_rgb) {
    return invalid(file, fmt::format("needs a depth (Z), a mask or alpha (mask, A), or a beauty "
                                     "(R, G, B) channel; its channels are: {}",
                                     channel_list(image)));
  }

  Planes planes;
  planes.width = image.width;
  planes.height = image.height;
  if (depth) {
    auto values = finite_plane(*depth, pixels, image, file);
    if (!values) return values.error();
    planes.z = std::move(*values);
    planes.depth_channel = depth->name;
    for (float& z : planes.z) {
      if (std::abs(z) >= kBackground) z = kInfinity;
    }
  }
  if (mask) {
    auto values = finite_plane(*mask, pixels, image, file);
    if (!values) return values.error();
    planes.mask.resize(pixels);
    for (std::size_t i = 0; i < pixels; ++i) planes.mask[i] = (*values)[i] >= 0.5f;
    // What lies behind the background is nobody's promise.
    for (std::size_t i = 0; i < planes.z.size(); ++i) {
      if (!planes.mask[i]) planes.z[i] = kInfinity;
    }
    // A picture that is opaque throughout has no silhouette.
    const bool opaque =
        std::all_of(planes.mask.begin(), planes.mask.end(), [](auto m) { return m; });
    if (!depth && opaque && has_rgb) planes.mask.clear();
  } else if (depth) {
    planes.mask.resize(pixels);
    for (std::size_t i = 0; i < pixels; ++i) planes.mask[i] = std::isfinite(planes.z[i]);
  }
  if (id) {
    planes.object_id.resize(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      planes.object_id[i] =
          id->type == image::SampleType::uint32
              ? id->uints[i]
              : static_cast<std::uint32_t>(std::clamp(std::round(id->floats[i]), 0.0f, 4.2e9f));
    }
  }
  if (has_rgb) {
    planes.rgb.resize(3 * pixels);
    for (int c = 0; c < 3; ++c) {
      auto values = finite_plane(*rgb[c], pixels, image, file);
      if (!values) return values.error();
      for (std::size_t i = 0; i < pixels; ++i) planes.rgb[3 * i + c] = (*values)[i];
    }
  }
  return planes;
}

Result<Planes> planes_from_povray(const image::Image& image, double far_distance,
                                  const std::string& file) {
  if (auto checked = check(image, file); !checked) return checked.error();
  if (!(far_distance > 0.0) || !std::isfinite(far_distance)) {
    return Error{Exit::internal, "", "the far distance must be positive", file, ""};
  }
  const Plane* channels[3] = {find(image, {"r"}), find(image, {"g"}), find(image, {"b"})};
  if (!channels[0] || !channels[1] || !channels[2]) {
    return invalid(file, fmt::format("needs the channels R, G and B of a 16-bit PNG; its channels "
                                     "are: {}",
                                     channel_list(image)));
  }
  const std::size_t pixels = std::size_t{image.width} * image.height;
  const auto integer = [&](int c,
                           std::size_t i) {  // float32 holds v / 65535 well enough to undo it
    return channels[c]->type == image::SampleType::uint32
               ? channels[c]->uints[i]
               : static_cast<std::uint32_t>(
                     std::lround(std::clamp(channels[c]->floats[i], 0.0f, 1.0f) * 65535.0));
  };

  Planes planes;
  planes.width = image.width;
  planes.height = image.height;
  planes.depth_channel = "R, G (30 bits)";
  planes.mask.resize(pixels);
  planes.z.assign(pixels, kInfinity);
  planes.object_id.resize(pixels);
  const double unit = far_distance / (double{kHalf} * kHalf);
  for (std::size_t i = 0; i < pixels; ++i) {
    planes.object_id[i] = integer(2, i);
    planes.mask[i] = planes.object_id[i] != 0;
    if (!planes.mask[i]) continue;
    const std::uint32_t high = integer(0, i), low = integer(1, i);
    if (high >= kHalf || low >= kHalf) {
      return invalid(file, fmt::format("pixel ({}, {}) holds {} and {}, and an encoded depth stays "
                                       "below {}: was the image written with a gamma?",
                                       i % image.width, i / image.width, high, low, kHalf));
    }
    const double q = double(high) * kHalf + double(low);
    planes.z[i] = static_cast<float>(q * unit);
  }
  return planes;
}

}  // namespace octrace::validation
