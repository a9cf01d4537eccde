#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "exporters/camera_frame.h"
#include "exporters/gltf/parts.h"

namespace octrace::exporters {

namespace {

using Json = nlohmann::ordered_json;

Json numbers(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

// Cameras and lights look along their own -Z.
Json placement(const glm::dvec3& position, const glm::dmat3& axes) {
  const glm::dquat q = glm::normalize(glm::quat_cast(axes));
  return {{"rotation", {q.x, q.y, q.z, q.w}}, {"translation", numbers(position)}};
}

glm::dmat3 axes_towards(const glm::dvec3& direction) {
  const glm::dvec3 back = -glm::normalize(direction);
  const glm::dvec3 helper = std::abs(back.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 right = glm::normalize(glm::cross(helper, back));
  return {right, glm::cross(back, right), back};
}

double scene_size(const scene::Scene& scene) {
  const glm::dvec3 extent = glm::dvec3(scene.bounds.upper) - glm::dvec3(scene.bounds.lower);
  const double size = scene.bounds.empty ? 0.0 : glm::length(extent);
  return size > 0.0 ? size : 1.0;
}

Json camera_record(GltfJob& job, const scene::Camera& camera) {
  Json record;
  if (!camera.name.empty()) record["name"] = camera.name;
  const double size = scene_size(job.scene);
  if (camera.type == scene::CameraType::orthographic) {
    // glTF wants both planes here; beyond a thousand times the scene there is nothing to clip.
    const double far = std::isfinite(camera.zfar) ? camera.zfar : 1000.0 * size + camera.znear;
    record["type"] = "orthographic";
    record["orthographic"] = {
        {"xmag", camera.xmag}, {"ymag", camera.ymag}, {"zfar", far}, {"znear", camera.znear}};
    return record;
  }
  record["type"] = "perspective";
  double yfov = camera.yfov;
  if (camera.type == scene::CameraType::pinhole) {
    const CameraFrame frame =
        camera_frame(camera, static_cast<int>(camera.width), static_cast<int>(camera.height));
    yfov = 2.0 * std::atan(0.5 * (frame.top - frame.bottom));
    job.note("a pinhole camera lost its principal point and the ratio of its focal lengths");
  }
  Json perspective{{"yfov", yfov}};
  // glTF does not allow 0.
  perspective["znear"] = camera.znear > 0.0 ? camera.znear : 1e-6 * size;
  if (std::isfinite(camera.zfar)) perspective["zfar"] = camera.zfar;
  record["perspective"] = std::move(perspective);
  return record;
}

void append_cameras(GltfJob& job, Json& roots) {
  for (const scene::Camera& camera : job.scene.cameras) {
    if (camera.type == scene::CameraType::pinhole && !(camera.width > 0 && camera.height > 0)) {
      job.note("a pinhole camera without an image size was left out");
      continue;
    }
    // The magnitudes keep their signs in the record, so they must not turn the axes too.
    scene::Camera upright = camera;
    upright.xmag = std::abs(camera.xmag);
    upright.ymag = std::abs(camera.ymag);
    const CameraFrame frame = camera_frame(upright, 1, 1);
    const glm::dmat3 axes(frame.right, frame.up, frame.back);
    if (glm::determinant(axes) < 0.0) job.note("a mirrored camera lost its mirroring");
    const glm::dmat3 proper(glm::cross(frame.up, frame.back), frame.up, frame.back);
    Json node;
    if (!camera.name.empty()) node["name"] = camera.name;
    node["camera"] = job.glb.add("cameras", camera_record(job, camera));
    node.update(placement(frame.eye, proper));
    roots.push_back(job.glb.add("nodes", std::move(node)));
  }
}

Json light_record(GltfJob& job, const kernels::Light& light) {
  Json record;
  const glm::dvec3 intensity(light.intensity);
  const double strength = std::max({intensity.x, intensity.y, intensity.z, 0.0});
  const glm::dvec3 color = strength > 0.0 ? intensity / strength : glm::dvec3(1.0);
  record["color"] = numbers(glm::max(glm::min(color, glm::dvec3(1.0)), glm::dvec3(0.0)));
  record["intensity"] = strength;
  if (light.type == kernels::LightType::directional) {
    record["type"] = "directional";
    return record;
  }
  if (std::isfinite(light.range) && light.range > 0.0f) record["range"] = light.range;
  if (light.type == kernels::LightType::point) {
    record["type"] = "point";
    return record;
  }
  record["type"] = "spot";
  const double cos_outer = -double(light.spot_offset) / light.spot_scale;
  const double cos_inner = cos_outer + 1.0 / light.spot_scale;
  const double outer = std::acos(std::clamp(cos_outer, 0.0, 1.0));
  // glTF wants the inner angle below the outer one.
  const double inner = std::min(std::acos(std::clamp(cos_inner, -1.0, 1.0)), outer * (1.0 - 1e-9));
  record["spot"] = {{"innerConeAngle", std::max(inner, 0.0)}, {"outerConeAngle", outer}};
  if (cos_outer < 0.0) job.note("a spot light wider than a half-space was narrowed to one");
  return record;
}

void append_lights(GltfJob& job, Json& roots) {
  if (job.scene.lights.empty()) return;
  Json lights = Json::array();
  for (const kernels::Light& light : job.scene.lights) {
    lights.push_back(light_record(job, light));
    const bool aimed = light.type != kernels::LightType::point;
    const bool placed = light.type != kernels::LightType::directional;
    Json node = placement(placed ? glm::dvec3(light.position) : glm::dvec3(0.0),
                          aimed ? axes_towards(glm::dvec3(light.direction)) : glm::dmat3(1.0));
    node["extensions"]["KHR_lights_punctual"]["light"] = lights.size() - 1;
    roots.push_back(job.glb.add("nodes", std::move(node)));
  }
  job.glb.json()["extensions"]["KHR_lights_punctual"]["lights"] = std::move(lights);
  job.glb.use_extension("KHR_lights_punctual");
}

}  // namespace

void append_nodes(GltfJob& job) {
  const scene::Scene& scene = job.scene;
  std::size_t count = scene.object_names.size();
  for (const auto& geometry : scene.geometries)
    count = std::max<std::size_t>(count, geometry.object + 1);

  std::vector<std::vector<std::uint32_t>> of_object(count);
  std::vector<std::uint32_t> order;  // as the triangles come, so that their ids stay
  for (std::uint32_t i = 0; i < scene.geometries.size(); ++i) {
    const kernels::Geometry& geometry = scene.geometries[i];
    if (geometry.triangle_count == 0 || geometry.vertex_count == 0) continue;
    if (of_object[geometry.object].empty()) order.push_back(geometry.object);
    of_object[geometry.object].push_back(i);
  }

  for (std::uint32_t i = 0; i < count; ++i) {
    Json node = Json::object();
    if (i < scene.object_names.size() && !scene.object_names[i].empty()) {
      node["name"] = scene.object_names[i];
    }
    if (!of_object[i].empty()) node["mesh"] = append_mesh(job, i, of_object[i]);
    job.glb.add("nodes", std::move(node));
  }

  Json roots = order;
  append_cameras(job, roots);
  append_lights(job, roots);
  if (roots.empty() && count > 0) roots.push_back(0);
  Json record = Json::object();
  if (!roots.empty()) record["nodes"] = std::move(roots);
  job.glb.json()["scenes"] = Json::array({std::move(record)});
  job.glb.json()["scene"] = 0;
}

}  // namespace octrace::exporters
