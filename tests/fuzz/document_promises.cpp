#include "tests/fuzz/document_promises.h"

#include <cmath>

#include "backend/gltf/document.h"

namespace octrace::tests {
namespace {

using gltf::Document;

// Keeps an input of a few kilobytes from asking for gigabytes, as accessors without a view may.
constexpr std::uint64_t kMaxSceneBytes = 8 << 20;

bool is_index(int value, std::size_t size, bool may_be_absent = true) {
  return (may_be_absent && value == -1) || (value >= 0 && static_cast<std::size_t>(value) < size);
}

std::string check_accessors(const Document& document) {
  const auto& model = document.model;
  for (std::size_t i = 0; i < model.accessors.size(); ++i) {
    const auto& accessor = model.accessors[i];
    const auto components = static_cast<std::size_t>(
        tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type)));
    const auto values = document.read_floats(static_cast<int>(i));
    if (values.size() != accessor.count * components) return "an accessor's size";
    for (const float value : values) {
      if (!std::isfinite(value)) return "a finite accessor";
    }
  }
  return "";
}

std::string check_primitive(const Document& document, const tinygltf::Primitive& primitive) {
  const auto& model = document.model;
  if (primitive.attributes.empty()) return "a primitive's attributes";
  if (!is_index(primitive.material, model.materials.size())) return "a material";
  std::size_t vertices = 0;
  for (const auto& [name, index] : primitive.attributes) {
    if (!is_index(index, model.accessors.size(), false)) return "an attribute";
    vertices = model.accessors[static_cast<std::size_t>(index)].count;
  }
  std::vector<std::map<std::string, int>> all = primitive.targets;
  all.push_back(primitive.attributes);
  for (const auto& attributes : all) {
    for (const auto& [name, index] : attributes) {
      if (!is_index(index, model.accessors.size(), false)) return "a target's attribute";
      if (model.accessors[static_cast<std::size_t>(index)].count != vertices) return "equal counts";
    }
  }
  if (!is_index(primitive.indices, model.accessors.size())) return "an index accessor";
  if (primitive.indices >= 0) {
    for (const std::uint32_t value : document.read_uints(primitive.indices)) {
      if (value >= vertices) return "indices below the vertex count";
    }
  }
  return "";
}

std::string check_nodes(const Document& document) {
  const auto& model = document.model;
  std::vector<int> parents(model.nodes.size());
  for (const auto& node : model.nodes) {
    if (!is_index(node.mesh, model.meshes.size()) || !is_index(node.skin, model.skins.size()) ||
        !is_index(node.camera, model.cameras.size())) {
      return "a node's references";
    }
    if (!node.matrix.empty() && node.matrix.size() != 16) return "a matrix of 16";
    if (!node.rotation.empty() && node.rotation.size() != 4) return "a rotation of 4";
    for (const int child : node.children) {
      if (!is_index(child, model.nodes.size(), false)) return "a child";
      if (++parents[static_cast<std::size_t>(child)] > 1) return "one parent";
    }
    if (node.skin < 0) continue;
    const std::size_t joints = model.skins[static_cast<std::size_t>(node.skin)].joints.size();
    for (const auto& primitive : model.meshes[static_cast<std::size_t>(node.mesh)].primitives) {
      const auto found = primitive.attributes.find("JOINTS_0");
      if (found == primitive.attributes.end()) continue;
      for (const std::uint32_t joint : document.read_uints(found->second)) {
        if (joint >= joints) return "joints below the skin's count";
      }
    }
  }
  for (const auto& scene : model.scenes) {
    for (const int node : scene.nodes) {
      if (!is_index(node, model.nodes.size(), false)) return "a scene's node";
    }
  }
  // One parent at most and as many edges as reach every node once: what no root reaches is a loop.
  std::vector<std::size_t> open;
  std::size_t reached = 0;
  for (std::size_t i = 0; i < parents.size(); ++i) {
    if (parents[i] == 0) open.push_back(i);
  }
  while (!open.empty()) {
    const std::size_t node = open.back();
    open.pop_back();
    ++reached;
    for (const int child : model.nodes[node].children) {
      open.push_back(static_cast<std::size_t>(child));
    }
  }
  return reached == parents.size() ? "" : "a tree";
}

std::string check_animations(const Document& document) {
  const auto& model = document.model;
  for (const auto& animation : model.animations) {
    for (const auto& channel : animation.channels) {
      if (!is_index(channel.target_node, model.nodes.size(), false)) return "a target node";
      if (!is_index(channel.sampler, animation.samplers.size(), false)) return "a sampler";
    }
    for (const auto& sampler : animation.samplers) {
      if (!is_index(sampler.output, model.accessors.size(), false)) return "a sampler's output";
      if (!is_index(sampler.input, model.accessors.size(), false)) return "a sampler's input";
      const auto times = document.read_floats(sampler.input);
      for (std::size_t i = 1; i < times.size(); ++i) {
        if (!(times[i] > times[i - 1])) return "increasing times";
      }
    }
  }
  return "";
}

std::string check_materials(const Document& document) {
  const auto& model = document.model;
  for (const auto& material : model.materials) {
    for (const int index : {material.pbrMetallicRoughness.baseColorTexture.index,
                            material.pbrMetallicRoughness.metallicRoughnessTexture.index,
                            material.normalTexture.index, material.occlusionTexture.index,
                            material.emissiveTexture.index}) {
      if (!is_index(index, model.textures.size())) return "a material's texture";
    }
    if (material.pbrMetallicRoughness.baseColorFactor.size() != 4) return "a colour of 4";
    if (material.emissiveFactor.size() != 3) return "an emission of 3";
  }
  for (const auto& texture : model.textures) {
    if (!is_index(texture.source, document.images.size())) return "a texture's image";
    if (!is_index(texture.sampler, model.samplers.size())) return "a texture's sampler";
  }
  return "";
}

}  // namespace

std::string broken_promise(const std::vector<std::uint8_t>& bytes, const std::string& name) {
  gltf::LoadOptions options;
  options.limits.max_scene_bytes = kMaxSceneBytes;
  const auto document = gltf::load_bytes(bytes, name, options);
  if (!document) {
    if (document.error().exit == util::Exit::internal) return document.error().to_string();
    return document.error().code.empty() ? "an error's code" : "";
  }
  if (document->images.size() != document->model.images.size()) return "an image for each";
  for (const auto& check : {check_accessors, check_nodes, check_animations, check_materials}) {
    if (auto broken = check(*document); !broken.empty()) return broken;
  }
  for (const auto& mesh : document->model.meshes) {
    if (mesh.primitives.empty()) return "a mesh's primitives";
    for (const auto& primitive : mesh.primitives) {
      if (auto broken = check_primitive(*document, primitive); !broken.empty()) return broken;
    }
  }
  return "";
}

}  // namespace octrace::tests
