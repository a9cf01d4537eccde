// nerfstudio's transforms.json: https://docs.nerf.studio/quickstart/data_conventions.html
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "backend/batch/camera_sets.h"

namespace octrace::batch {

namespace {

using util::Result;

// What a frame says itself goes before what the file says for all.
struct Members {
  const JsonAt &frame, &all;
  const JsonAt* with(const char* key) const {
    return frame.has(key) ? &frame : all.has(key) ? &all : nullptr;
  }
  Result<double> number(const char* key, double least, double most) const {
    return with(key)->at(key).number(least, most);
  }
};

Result<void> check_model(const Members& members) {
  const auto unsupported = [](const JsonAt& place, const std::string& message) {
    util::Error error = place.error(message);
    error.exit = util::Exit::unsupported;
    return error;
  };
  if (const JsonAt* has = members.with("camera_model")) {
    const JsonAt model = has->at("camera_model");
    auto text = model.text();
    if (!text) return text.error();
    if (*text != "OPENCV" && *text != "PINHOLE" && *text != "SIMPLE_PINHOLE") {
      return unsupported(model, fmt::format("is {}; only pinhole cameras are rendered: OPENCV "
                                            "without distortion, PINHOLE, SIMPLE_PINHOLE",
                                            *text));
    }
  }
  for (const char* key : {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}) {
    if (members.with(key) == nullptr) continue;
    auto value = members.number(key, -1e9, 1e9);
    if (!value) return value.error();
    if (*value != 0.0) {
      return unsupported(
          members.with(key)->at(key),
          fmt::format("is {:g}; distortion is not rendered: undistort, or set 0", *value));
    }
  }
  return {};
}

// The focal length from its own member or the angle over a side.
Result<double> focal(const Members& members, const char* key, const char* angle, double side) {
  if (members.with(key) != nullptr) return members.number(key, 1e-9, 1e9);
  if (members.with(angle) == nullptr) return 0.0;
  auto radians = members.number(angle, 1e-6, 3.14159);
  if (!radians) return radians.error();
  return 0.5 * side / std::tan(0.5 * *radians);
}

Result<scene::Camera> read_frame(const JsonAt& frame, const JsonAt& all, const ImageSize& image) {
  const Members members{frame, all};
  if (!frame.value().is_object()) return frame.needs("an object");
  if (!frame.has("transform_matrix")) return frame.error("needs \"transform_matrix\"");
  scene::Camera camera;
  camera.type = scene::CameraType::pinhole;
  if (auto ok = check_model(members); !ok) return ok.error();
  auto matrix = parse_matrix(frame.at("transform_matrix"));
  if (!matrix) return matrix.error();
  camera.matrix = *matrix;
  const bool sized = members.with("w") != nullptr && members.with("h") != nullptr;
  // Synthetic data sets give an angle and no size: it holds for the width of whatever is rendered.
  if (!sized) {
    if (members.with("camera_angle_x") == nullptr || members.with("fl_x") != nullptr) {
      return frame.error("needs \"w\" and \"h\" in pixels, here or at the top");
    }
    camera.width = image.width;
    camera.height = image.height;
  }
  const struct {
    const char* key;
    double& into;
  } sides[] = {{"w", camera.width}, {"h", camera.height}};
  for (const auto& side : sides) {
    if (!sized) break;
    auto value = members.number(side.key, 1, 1e9);
    if (!value) return value.error();
    side.into = *value;
  }
  auto fx = focal(members, "fl_x", "camera_angle_x", camera.width);
  if (!fx) return fx.error();
  auto fy = focal(members, "fl_y", "camera_angle_y", camera.height);
  if (!fy) return fy.error();
  if (*fx == 0.0 && *fy == 0.0) return frame.error("needs \"fl_x\" or \"camera_angle_x\"");
  camera.fx = *fx > 0.0 ? *fx : *fy;  // one alone: square pixels
  camera.fy = *fy > 0.0 ? *fy : *fx;
  camera.cx = 0.5 * camera.width;
  camera.cy = 0.5 * camera.height;
  if (auto ok = read_member(members.with("cx") != nullptr ? *members.with("cx") : frame, "cx",
                            camera.cx, [](const JsonAt& at) { return at.number(-1e9, 1e9); });
      !ok)
    return ok.error();
  if (auto ok = read_member(members.with("cy") != nullptr ? *members.with("cy") : frame, "cy",
                            camera.cy, [](const JsonAt& at) { return at.number(-1e9, 1e9); });
      !ok)
    return ok.error();
  return camera;
}

}  // namespace

Result<std::vector<scene::Camera>> read_transforms(const std::string& path, const ImageSize& image,
                                                   const util::Limits& limits) {
  auto json = read_json_file(path, limits, util::Exit::invalid_input);
  if (!json) return json.error();
  const JsonAt root(*json, path, util::Exit::invalid_input);
  if (!root.has("frames")) return root.error("needs \"frames\"");
  const JsonAt frames = root.at("frames");
  auto count = frames.array(1, limits.max_views);
  if (!count) return count.error();
  std::vector<scene::Camera> cameras;
  for (std::size_t i = 0; i < *count; ++i) {
    const JsonAt frame = frames.at(i);
    auto camera = read_frame(frame, root, image);
    if (!camera) return camera.error();
    camera->name = numbered("frame", i, *count);
    if (frame.has("file_path")) {
      auto file = frame.at("file_path").text();
      if (!file) return file.error();
      const std::string stem = std::filesystem::path(*file).stem().string();
      if (!stem.empty()) camera->name = stem;
    }
    cameras.push_back(std::move(*camera));
  }
  return cameras;
}

}  // namespace octrace::batch
