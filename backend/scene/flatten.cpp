#include "backend/scene/flatten.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <set>

#include "backend/scene/flatten_materials.h"
#include "backend/scene/flatten_placed.h"
#include "backend/scene/flatten_steps.h"
#include "backend/scene/names.h"
#include "backend/scene/pose.h"

namespace octrace::scene {

namespace {

// The nodes that a scene shows start from these.
util::Result<std::vector<int>> root_nodes(const gltf::Document& document,
                                          std::optional<int> chosen) {
  const tinygltf::Model& model = document.model;
  if (chosen && (*chosen < 0 || static_cast<std::size_t>(*chosen) >= model.scenes.size())) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < model.scenes.size() && i < 10; ++i) {
      names.push_back(fmt::format("{} \"{}\"", i, printable(name_of(model.scenes, i, "scene"))));
    }
    if (model.scenes.size() > names.size()) names.push_back("...");
    return util::Error{
        util::Exit::usage, "",
        fmt::format("there is no scene {}; the file has {}{}{}", *chosen, model.scenes.size(),
                    names.empty() ? "" : ": ", fmt::join(names, ", ")),
        document.file, ""};
  }
  if (!model.scenes.empty()) {
    const int index = chosen ? *chosen : std::max(model.defaultScene, 0);
    return model.scenes[index].nodes;
  }
  std::vector<bool> is_child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int child : node.children) is_child[child] = true;
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (!is_child[i]) roots.push_back(static_cast<int>(i));
  }
  return roots;
}

// Keeps the first of each, in order.
void drop_duplicates(std::vector<std::string>& lines) {
  std::set<std::string> seen;
  std::erase_if(lines, [&](const std::string& line) { return !seen.insert(line).second; });
}

}  // namespace

std::vector<int> reachable_nodes(const tinygltf::Model& model, const std::vector<int>& roots) {
  std::vector<bool> reached(model.nodes.size(), false);
  std::vector<int> pending = roots;
  while (!pending.empty()) {
    const int node = pending.back();
    pending.pop_back();
    if (reached[node]) continue;
    reached[node] = true;
    const auto& children = model.nodes[node].children;
    pending.insert(pending.end(), children.begin(), children.end());
  }
  std::vector<int> nodes;
  for (std::size_t i = 0; i < reached.size(); ++i) {
    if (reached[i]) nodes.push_back(static_cast<int>(i));
  }
  return nodes;
}

util::Result<int> find_variant(const gltf::Document& document, const std::string& variant) {
  if (variant.empty()) return -1;
  const std::vector<std::string> names = gltf::variant_names(document.model);
  const auto found = std::find(names.begin(), names.end(), variant);
  if (found != names.end()) return static_cast<int>(found - names.begin());
  std::size_t index = 0;
  const char* end = variant.data() + variant.size();
  const auto [stop, error] = std::from_chars(variant.data(), end, index);
  if (error == std::errc() && stop == end && index < names.size()) return static_cast<int>(index);
  std::string there;
  for (std::size_t i = 0; i < names.size() && i < 10; ++i) {
    there += fmt::format("{}{} \"{}\"", i > 0 ? ", " : "", i, printable(names[i]));
  }
  if (names.size() > 10) there += ", ...";
  return util::Error{
      util::Exit::usage, "",
      fmt::format("--variant {}: there is no such variant; the file has {}{}{}", printable(variant),
                  names.size(), names.empty() ? "" : ": ", there),
      document.file, ""};
}

std::vector<int> visible_nodes(const tinygltf::Model& model, const std::vector<int>& nodes) {
  std::vector<int> hidden;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (!gltf::node_visible(model.nodes[i])) hidden.push_back(static_cast<int>(i));
  }
  if (hidden.empty()) return nodes;
  hidden = reachable_nodes(model, hidden);
  std::vector<int> visible;
  std::set_difference(nodes.begin(), nodes.end(), hidden.begin(), hidden.end(),
                      std::back_inserter(visible));
  return visible;
}

util::Result<Scene> flatten(const gltf::Document& document, const FlattenOptions& options) {
  return flatten(document, static_pose(document.model), options);
}

util::Result<Scene> flatten(const gltf::Document& document, const Pose& pose,
                            const FlattenOptions& options) {
  const auto plan = plan_scene(document, options);
  if (!plan) return plan.error();
  Winding winding;
  return place_scene(document, *plan, pose, options, winding);
}

util::Result<ScenePlan> plan_scene(const gltf::Document& document, const FlattenOptions& options) {
  const tinygltf::Model& model = document.model;
  if (model.nodes.size() > options.limits.max_nodes) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("has {} nodes, --max-nodes allows {}", model.nodes.size(),
                                   options.limits.max_nodes),
                       document.file, "/nodes"};
  }
  const auto roots = root_nodes(document, options.scene);
  if (!roots) return roots.error();
  const auto variant = find_variant(document, options.variant);
  if (!variant) return variant.error();
  ScenePlan plan;
  plan.nodes = reachable_nodes(model, *roots);
  plan.visible = visible_nodes(model, plan.nodes);
  auto instances = plan_instances(document, plan.visible, *variant, options.limits);
  if (!instances) return instances.error();
  plan.instances = std::move(*instances);
  auto geometry = plan_geometry(document, plan.instances.plain_nodes, *variant, options.limits);
  if (!geometry) return geometry.error();
  plan.geometry = std::move(*geometry);
  auto fits = check_sum(document, plan.geometry, plan.instances, options.limits);
  if (!fits) return fits.error();
  return plan;
}

util::Result<Scene> place_scene(const gltf::Document& document, const ScenePlan& plan,
                                const Pose& pose, const FlattenOptions& options, Winding& winding) {
  const tinygltf::Model& model = document.model;
  Scene scene;
  scene.warnings = plan.geometry.warnings;
  const GeometryPlan& meshes = plan.instances.meshes;
  scene.warnings.insert(scene.warnings.end(), meshes.warnings.begin(), meshes.warnings.end());
  const std::vector<glm::dmat4> worlds = world_matrices(model, pose);
  if (auto ok = place_geometry(document, plan.geometry, pose, worlds, scene, winding); !ok) {
    return ok.error();
  }
  if (auto ok = place_instances(document, plan.instances, pose, worlds, false, scene); !ok) {
    return ok.error();
  }
  if (auto ok = place_cameras(document, plan.nodes, worlds, scene); !ok) return ok.error();
  if (auto ok = place_lights(document, plan.visible, worlds, scene); !ok) return ok.error();
  const bool default_material = plan.geometry.default_material || meshes.default_material;
  if (auto ok = place_materials(document, options, default_material, scene); !ok) {
    return ok.error();
  }
  drop_duplicates(scene.warnings);
  scene.object_names.reserve(model.nodes.size());
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    scene.object_names.push_back(name_of(model.nodes, i, "node"));
    const int mesh = model.nodes[i].mesh;
    scene.object_meshes.push_back(mesh < 0 ? "" : name_of(model.meshes, mesh, "mesh"));
  }
  append_instance_names(document, plan.instances, scene);
  return scene;
}

}  // namespace octrace::scene
