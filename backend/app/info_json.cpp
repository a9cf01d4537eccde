#include <cmath>
#include <nlohmann/json.hpp>

#include "backend/app/info_report.h"
#include "backend/app/octree_json.h"

namespace octrace::app {

namespace {

using nlohmann::ordered_json;

// JSON has no infinity: no zfar and no range are null.
ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json cameras(const scene::SceneInfo& info) {
  ordered_json out = ordered_json::array();
  for (const auto& camera : info.cameras) {
    ordered_json entry = {{"name", camera.name}, {"type", camera.type}};
    if (camera.type == "perspective") entry["yfov"] = camera.yfov;
    if (camera.type == "orthographic") {
      entry["xmag"] = camera.xmag;
      entry["ymag"] = camera.ymag;
    }
    entry["znear"] = camera.znear;
    entry["zfar"] = number(camera.zfar);
    entry["eye"] = camera.eye;
    entry["direction"] = camera.direction;
    out.push_back(std::move(entry));
  }
  return out;
}

ordered_json meshes(const scene::SceneInfo& info) {
  ordered_json out = ordered_json::array();
  for (const auto& mesh : info.meshes) {
    out.push_back({{"name", mesh.name},
                   {"primitives", mesh.primitives},
                   {"triangles", mesh.triangles},
                   {"vertices", mesh.vertices},
                   {"points_and_lines", mesh.points_and_lines},
                   {"morph_targets", mesh.morph_targets},
                   {"instances", mesh.instances},
                   {"attributes", mesh.attributes}});
  }
  return out;
}

ordered_json materials(const scene::SceneInfo& info) {
  ordered_json out = ordered_json::array();
  for (const auto& material : info.materials) {
    out.push_back({{"name", material.name},
                   {"alpha_mode", material.alpha_mode},
                   {"double_sided", material.double_sided},
                   {"unlit", material.unlit},
                   {"textures", material.textures},
                   {"extensions", material.extensions}});
  }
  return out;
}

ordered_json lights(const scene::SceneInfo& info) {
  ordered_json out = ordered_json::array();
  for (const auto& light : info.lights) {
    out.push_back({{"name", light.name},
                   {"type", light.type},
                   {"color", light.color},
                   {"intensity", light.intensity},
                   {"range", number(light.range)}});
  }
  return out;
}

ordered_json animations(const scene::SceneInfo& info) {
  ordered_json out = ordered_json::array();
  for (const auto& animation : info.animations) {
    ordered_json targets = ordered_json::array();
    for (const auto& target : animation.targets) {
      targets.push_back({{"node", target.node},
                         {"path", target.path},
                         {"interpolation", target.interpolation},
                         {"keys", target.keys}});
    }
    out.push_back({{"name", animation.name},
                   {"channels", animation.channels},
                   {"start", animation.start},
                   {"end", animation.end},
                   {"paths", animation.paths},
                   {"targets", std::move(targets)}});
  }
  return out;
}

ordered_json bounds(const scene::Bounds& box) {
  if (box.empty) return nullptr;
  return {{"lower", {box.lower.x, box.lower.y, box.lower.z}},
          {"upper", {box.upper.x, box.upper.y, box.upper.z}}};
}

}  // namespace

std::string info_json(const scene::SceneInfo& info, const octree::Statistics& octree) {
  ordered_json json = {{"source", info.source},
                       {"version", info.version},
                       {"generator", info.generator},
                       {"copyright", info.copyright},
                       {"default_scene", info.default_scene},
                       {"nodes", info.nodes},
                       {"hidden_nodes", info.hidden_nodes}};
  json["scenes"] = ordered_json::array();
  for (const auto& scene : info.scenes) {
    json["scenes"].push_back(
        {{"name", scene.name}, {"roots", scene.roots}, {"nodes", scene.nodes}});
  }
  json["cameras"] = cameras(info);
  json["meshes"] = meshes(info);
  json["materials"] = materials(info);
  json["lights"] = lights(info);
  json["animations"] = animations(info);
  json["skins"] = ordered_json::array();
  for (const auto& skin : info.skins) {
    json["skins"].push_back({{"name", skin.name}, {"joints", skin.joints}});
  }
  json["images"] = ordered_json::array();
  for (const auto& image : info.images) {
    json["images"].push_back({{"name", image.name}, {"mime", image.mime}, {"bytes", image.bytes}});
  }
  json["variants"] = ordered_json::array();
  for (const auto& variant : info.variants) {
    json["variants"].push_back({{"name", variant.name}, {"primitives", variant.primitives}});
  }
  json["extensions"] = ordered_json::array();
  for (const auto& extension : info.extensions) {
    json["extensions"].push_back({{"name", extension.name},
                                  {"required", extension.required},
                                  {"honoured", extension.honoured}});
  }
  json["flattened"] = {{"objects", info.objects},      {"geometries", info.geometries},
                       {"triangles", info.triangles},  {"vertices", info.vertices},
                       {"lights", info.lights_placed}, {"textures", info.textures},
                       {"texels", info.texels},        {"bytes", info.bytes},
                       {"bounds", bounds(info.bounds)}};
  json["instances"] = {{"count", info.instances},
                       {"meshes", info.instanced_meshes},
                       {"triangles_kept", info.instanced_triangles_kept},
                       {"triangles_shown", info.instanced_triangles_shown}};
  json["octree"] = octree_json(octree);
  // A name that is not UTF-8 must not stop the report.
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace octrace::app
