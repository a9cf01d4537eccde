#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "backend/gltf/instancing.h"
#include "backend/scene/instances.h"
#include "backend/scene/names.h"

namespace octrace::scene {

namespace {

bool has_targets(const tinygltf::Mesh& mesh) {
  return std::any_of(mesh.primitives.begin(), mesh.primitives.end(),
                     [](const auto& primitive) { return !primitive.targets.empty(); });
}

}  // namespace

std::uint64_t InstancePlan::bytes() const {
  // Two strings, which are mostly short enough to need no memory of their own.
  return meshes.bytes() + instances * (sizeof(kernels::Instance) + 3 * sizeof(std::string));
}

util::Result<InstancePlan> plan_instances(const gltf::Document& document,
                                          const std::vector<int>& nodes, int variant,
                                          const util::Limits& limits) {
  const tinygltf::Model& model = document.model;
  InstancePlan plan;
  const std::uint64_t first_object = model.nodes.size();  // the file's nodes come first
  // Nodes that show the same mesh share it, unless their own weights may morph it differently.
  std::map<int, std::uint32_t> shared;
  for (const int node : nodes) {
    const auto accessors = gltf::instance_accessors(model.nodes[node], model);
    if (!accessors) {
      plan.plain_nodes.push_back(node);
      continue;
    }
    const int mesh = model.nodes[node].mesh;
    auto index = static_cast<std::uint32_t>(plan.mesh_nodes.size());
    if (!has_targets(model.meshes[mesh])) index = shared.try_emplace(mesh, index).first->second;
    if (index == plan.mesh_nodes.size()) plan.mesh_nodes.push_back(node);
    const std::uint64_t first = first_object + plan.instances;
    plan.instances += accessors->count;  // each below 2^31
    // Object ids are indices + 1 in 32 bits.
    if (plan.instances > limits.max_instances || first_object + plan.instances >= kernels::kNone) {
      return util::Error{util::Exit::limit, "",
                         fmt::format("has {} instances or more, --max-instances allows {}",
                                     plan.instances, limits.max_instances),
                         document.file,
                         fmt::format("/nodes/{}/extensions/{}", node, gltf::kInstancingExtension)};
    }
    plan.nodes.push_back({node, index, static_cast<std::uint32_t>(first), accessors->count});
  }
  auto meshes = plan_geometry(document, plan.mesh_nodes, variant, limits);
  if (!meshes) return meshes.error();
  plan.meshes = std::move(*meshes);
  return plan;
}

util::Result<void> check_sum(const gltf::Document& document, const GeometryPlan& world,
                             const InstancePlan& instances, const util::Limits& limits) {
  const std::uint64_t triangles = world.triangles + instances.meshes.triangles;
  const std::uint64_t bytes = world.bytes() + instances.bytes();
  if (triangles > limits.max_triangles) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("needs {} triangles, --max-triangles allows {}", triangles,
                                   limits.max_triangles),
                       document.file, ""};
  }
  if (bytes > limits.max_scene_bytes) {
    return util::Error{
        util::Exit::limit, "",
        fmt::format("needs {} bytes, --max-scene-bytes allows {}", bytes, limits.max_scene_bytes),
        document.file, ""};
  }
  return {};
}

void append_instance_names(const gltf::Document& document, const InstancePlan& plan, Scene& scene) {
  const tinygltf::Model& model = document.model;
  scene.object_names.reserve(scene.object_names.size() + plan.instances);
  scene.object_meshes.reserve(scene.object_meshes.size() + plan.instances);
  for (const auto& shown : plan.nodes) {
    const std::string name = name_of(model.nodes, shown.node, "node");
    const std::string mesh = name_of(model.meshes, model.nodes[shown.node].mesh, "mesh");
    for (std::uint64_t i = 0; i < shown.count; ++i) {
      scene.object_names.push_back(fmt::format("{}[{}]", name, i));
      scene.object_meshes.push_back(mesh);
    }
  }
}

}  // namespace octrace::scene
