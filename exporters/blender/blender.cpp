#include "exporters/blender/blender.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "backend/util/atomic_file.h"
#include "exporters/camera_frame.h"

namespace octrace::exporters {

namespace {

constexpr const char* kScript =
#include "render_scene.inc"
    ;

nlohmann::ordered_json view_record(const BlenderView& view) {
  const CameraFrame frame = camera_frame(view.camera, view.width, view.height);
  nlohmann::ordered_json record;
  record["type"] = frame.orthographic ? "orthographic" : "perspective";
  std::vector<double> matrix;
  const glm::dvec3 columns[4] = {frame.right, frame.up, frame.back, frame.eye};
  for (int c = 0; c < 4; ++c) {
    matrix.insert(matrix.end(), {columns[c].x, columns[c].y, columns[c].z, c == 3 ? 1.0 : 0.0});
  }
  record["matrix"] = matrix;
  record["left"] = frame.left;
  record["right"] = frame.right_edge;
  record["bottom"] = frame.bottom;
  record["top"] = frame.top;
  record["width"] = view.width;
  record["height"] = view.height;
  record["clip_start"] = view.clip_start;
  record["clip_end"] = view.clip_end;
  record["output"] = view.output;
  return record;
}

nlohmann::ordered_json job_record(const std::vector<BlenderScene>& scenes) {
  nlohmann::ordered_json job;
  job["scenes"] = nlohmann::ordered_json::array();
  for (const BlenderScene& scene : scenes) {
    nlohmann::ordered_json record;
    record["file"] = scene.file;
    record["gltf_scene"] = nullptr;
    if (scene.gltf_scene) record["gltf_scene"] = *scene.gltf_scene;
    record["seconds"] = nullptr;
    if (scene.seconds) record["seconds"] = *scene.seconds;
    record["animation"] = scene.animation;
    record["cull"] = scene.cull;
    record["alpha"] = scene.alpha;
    record["views"] = nlohmann::ordered_json::array();
    for (const BlenderView& view : scene.views) record["views"].push_back(view_record(view));
    job["scenes"].push_back(record);
  }
  return job;
}

}  // namespace

void blender_clip(const scene::Bounds& bounds, BlenderView& view) {
  const CameraFrame frame = camera_frame(view.camera, view.width, view.height);
  double reach = 0.0;
  for (int corner = 0; corner < 8 && !bounds.empty; ++corner) {
    const glm::dvec3 point(corner & 1 ? bounds.upper.x : bounds.lower.x,
                           corner & 2 ? bounds.upper.y : bounds.lower.y,
                           corner & 4 ? bounds.upper.z : bounds.lower.z);
    reach = std::max(reach, glm::length(point - frame.eye));
  }
  if (!(reach > 0.0)) reach = 1.0;
  view.clip_start = view.camera.znear > 0.0 ? view.camera.znear : reach * 1e-5;
  view.clip_end = std::min(view.camera.zfar, reach * 4.0);
}

std::vector<std::string> blender_arguments(const std::string& script) {
  return {"-b", "--factory-startup", "-noaudio", "--python-exit-code", "3", "-P", script};
}

util::Result<void> write_blender(const std::vector<BlenderScene>& scenes, const std::string& path) {
  const nlohmann::ordered_json job = job_record(scenes);
  std::string text;
  try {
    text = job.dump(-1, ' ', true);
  } catch (const nlohmann::json::type_error&) {
    return util::Error{util::Exit::unsupported, "",
                       "a path of the Blender job is not UTF-8, which Python text must be", path,
                       ""};
  }
  // JSON's text escaped as JSON once more is pure ASCII and a valid Python string literal, whatever
  // names and paths it holds.
  const std::string literal = nlohmann::json(text).dump(-1, ' ', true);
  return util::write_file(
      path, fmt::format("import json\n\nJOB = json.loads({})\n\n{}", literal, kScript));
}

}  // namespace octrace::exporters
