#include "backend/batch/camera_choice.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "backend/scene/camera.h"

namespace octrace::batch {

namespace {

util::Error no_such_camera(const std::string& choice, const scene::Scene& scene) {
  std::string there;
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    there += fmt::format("{}{} ({})", i > 0 ? ", " : "", i, scene.cameras[i].name);
  }
  if (there.empty()) there = "none: without --camera the whole scene is framed";
  return {util::Exit::usage, "",
          fmt::format("--camera {}: there is no such camera; the scene has {}", choice, there), "",
          ""};
}

}  // namespace

util::Result<scene::Camera> choose_camera(const std::string& choice, const scene::Scene& scene,
                                          double aspect) {
  if (choice.empty()) {
    return scene.cameras.empty() ? scene::frame_bounds(scene.bounds, aspect)
                                 : scene.cameras.front();
  }
  if (choice.ends_with(".json")) return scene::read_camera_file(choice);
  for (const scene::Camera& camera : scene.cameras) {
    if (camera.name == choice) return camera;
  }
  std::size_t index = 0;
  const char* end = choice.data() + choice.size();
  const auto [stop, error] = std::from_chars(choice.data(), end, index);
  if (error != std::errc() || stop != end || index >= scene.cameras.size()) {
    return no_such_camera(choice, scene);
  }
  return scene.cameras[index];
}

std::string camera_json(const scene::Camera& camera) {
  nlohmann::ordered_json json;
  switch (camera.type) {
    case scene::CameraType::perspective:
      json["type"] = "perspective";
      json["yfov"] = camera.yfov;
      break;
    case scene::CameraType::orthographic:
      json["type"] = "orthographic";
      json["xmag"] = camera.xmag;
      json["ymag"] = camera.ymag;
      break;
    case scene::CameraType::pinhole:
      json["type"] = "pinhole";
      json["fx"] = camera.fx;
      json["fy"] = camera.fy;
      json["cx"] = camera.cx;
      json["cy"] = camera.cy;
      if (camera.width > 0 && camera.height > 0) {
        json["width"] = camera.width;
        json["height"] = camera.height;
      }
      break;
  }
  json["matrix"] = nlohmann::ordered_json::array();
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) json["matrix"].push_back(camera.matrix[column][row]);
  }
  json["znear"] = camera.znear;
  if (std::isfinite(camera.zfar)) json["zfar"] = camera.zfar;
  return json.dump();
}

}  // namespace octrace::batch
