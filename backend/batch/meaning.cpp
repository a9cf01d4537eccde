// What a job comes to, as the journal's header keeps it: everything that decides what is rendered.
#include <fmt/format.h>

#include "backend/batch/camera_choice.h"
#include "backend/batch/hash.h"
#include "backend/batch/plan.h"
#include "backend/batch/scene_probe.h"

namespace octrace::batch {

namespace {

using nlohmann::ordered_json;

ordered_json describe(const CameraEntry& entry) {
  if (std::holds_alternative<AllCameras>(entry)) return "all";
  if (const auto* named = std::get_if<NamedCamera>(&entry)) {
    return std::visit([](const auto& which) { return ordered_json(which); }, named->which);
  }
  if (const auto* given = std::get_if<GivenCameras>(&entry)) {
    std::uint64_t hash = kHashStart;
    for (const scene::Camera& camera : given->cameras) {
      hash = hash_text(camera.name + "\n" + camera_json(camera) + "\n", hash);
    }
    return {{"cameras", given->cameras.size()}, {"hash", fmt::format("{:016x}", hash)}};
  }
  const auto& orbit = std::get<OrbitCameras>(entry);
  ordered_json json = {{"n", orbit.n}, {"fov", orbit.fov}, {"name", orbit.name}};
  if (orbit.random) {
    json["seed"] = orbit.seed;
  } else {
    json["elevation"] = orbit.elevation;
    json["start"] = orbit.start;
  }
  if (orbit.distance) json["distance"] = *orbit.distance;
  if (orbit.target) json["target"] = {orbit.target->x, orbit.target->y, orbit.target->z};
  return {{orbit.random ? "hemisphere" : "turntable", json}};
}

// "1-120,200"
std::string frames_text(const std::vector<std::int64_t>& frames) {
  std::string text;
  for (std::size_t i = 0; i < frames.size();) {
    std::size_t end = i + 1;
    while (end < frames.size() && frames[end] == frames[end - 1] + 1) ++end;
    if (!text.empty()) text += ',';
    text += std::to_string(frames[i]);
    if (end > i + 1) text += fmt::format("-{}", frames[end - 1]);
    i = end;
  }
  return text;
}

ordered_json describe(const JobOutput& output) {
  ordered_json json = {{"path", output.pattern.text()}, {"aovs", ordered_json::array()}};
  for (const Output& file : output.files) {
    for (const render::AovInfo& info : render::aov_table()) {
      if (file.aovs.test(static_cast<std::size_t>(info.aov))) json["aovs"].push_back(info.option);
    }
  }
  return json;
}

}  // namespace

ordered_json Plan::meaning(const util::Limits& limits) const {
  ordered_json json;
  json["version"] = 1;
  json["scenes"] = ordered_json::array();
  for (const JobScene& scene : job_.scenes) {
    ordered_json entry = {{"path", scene.path}, {"name", scene.name}};
    if (scene.scene) entry["scene"] = *scene.scene;
    if (!scene.variant.empty()) entry["variant"] = scene.variant;
    entry["file"] = file_identity(scene, limits);
    json["scenes"].push_back(std::move(entry));
  }
  json["cameras"] = ordered_json::array();
  for (const CameraEntry& entry : job_.cameras) json["cameras"].push_back(describe(entry));
  if (!job_.frames.empty()) {
    json["frames"] = frames_text(job_.frames);
    json["fps"] = job_.fps;
  }
  if (job_.animation) {
    json["animation"] =
        std::visit([](const auto& which) { return ordered_json(which); }, *job_.animation);
  }
  json["size"] = {job_.size.width, job_.size.height};
  json["output"] = ordered_json::array();
  for (const JobOutput& output : job_.outputs) json["output"].push_back(describe(output));
  if (job_.pack) json["pack"] = {{"path", job_.pack->path.text()}, {"views", job_.pack->views}};
  const kernels::RenderParams& params = job_.params;
  json["spp"] = params.spp;
  json["seed"] = params.seed;
  json["sky"] = {params.sky.x, params.sky.y, params.sky.z};
  json["background"] = params.transparent_background == 1 ? "transparent" : "sky";
  json["cull"] = params.cull == 1 ? "spec" : "none";
  json["alpha"] = params.alpha == 1 ? "spec" : "ignore";
  json["depth_scale"] = job_.depth_scale;
  json["missing_images"] = job_.missing_images_warn ? "warn" : "error";
  json["compression"] = job_.compression;
  json["objects"] = job_.objects;
  json["masks"] = job_.coco_counts ? "coco_counts" : job_.coco_masks ? "coco" : "none";
  return json;
}

}  // namespace octrace::batch
