#include "validation/compare/read_planes.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

namespace octrace::validation {
namespace {

using util::Error;
using util::Exit;
using util::Result;

constexpr std::size_t kMaxSideFile = 1 << 20;

// Formats of 8 or 16 bits hold sRGB, and the metrics are defined on linear values.
bool holds_srgb(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension != ".exr" && extension != ".hdr" && extension != ".pfm";
}

void make_linear(std::vector<float>& samples) {
  for (float& v : samples) {
    v = v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
  }
}

// The far distance that the side file states, if it is one and speaks of this image.
std::optional<double> povray_far_distance(const std::string& path) {
  const std::filesystem::path image(path);
  if (image.extension() != ".png") return std::nullopt;
  std::ifstream stream(std::filesystem::path(image).replace_extension(".json"));
  std::string text(kMaxSideFile, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  const auto side = nlohmann::json::parse(text, nullptr, false);
  if (!side.is_object() || side.value("mode", nlohmann::json()) != "depth") return std::nullopt;
  if (side.value("image", nlohmann::json()) != image.filename().string()) return std::nullopt;
  const auto far = side.value("far", nlohmann::json());
  if (!far.is_number()) return std::nullopt;
  return far.get<double>();
}

}  // namespace

Result<PlanesFile> read_planes(const std::string& path, const util::Limits& limits) {
  auto image = image::read(path, limits);
  if (!image) return image.error();
  PlanesFile file;
  if (const auto far = povray_far_distance(path)) {
    if (!(*far > 0.0)) {
      return Error{Exit::invalid_input, "", "\"far\" beside it is not a positive number", path, ""};
    }
    auto planes = planes_from_povray(*image, *far, path);
    if (!planes) return planes.error();
    return PlanesFile{std::move(*planes), Writer::povray};
  }
  auto planes = planes_from_image(*image, path);
  if (!planes) return planes.error();
  if (holds_srgb(path)) make_linear(planes->rgb);
  const bool blender = planes->depth_channel.find(".Depth.") != std::string::npos;
  return PlanesFile{std::move(*planes), blender ? Writer::blender : Writer::unknown};
}

const Tolerances& tolerances_for(Writer writer) {
  switch (writer) {
    case Writer::povray:
      return kPovrayTolerances;
    case Writer::blender:
      return kBlenderTolerances;
    case Writer::unknown:
      return kDefaultTolerances;
  }
  return kDefaultTolerances;
}

const char* writer_name(Writer writer) {
  switch (writer) {
    case Writer::povray:
      return "POV-Ray";
    case Writer::blender:
      return "Blender";
    case Writer::unknown:
      return "any";
  }
  return "any";
}

}  // namespace octrace::validation
