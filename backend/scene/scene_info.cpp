#include "backend/scene/scene_info.h"

#include <fmt/format.h>
#include <algorithm>
#include <limits>
#include <numeric>
#include <set>

#include "backend/scene/flatten.h"
#include "backend/scene/instances.h"
#include "backend/scene/names.h"
#include "backend/scene/triangulate.h"

namespace octrace::scene {

namespace {

using tinygltf::Model;

void collect_flattened(const Scene& scene, SceneInfo& info) {
  std::set<std::uint32_t> objects;
  for (const kernels::Geometry& geometry : scene.geometries) objects.insert(geometry.object);
  info.objects = objects.size();
  info.geometries = scene.geometries.size();
  info.triangles = scene.triangles.size();
  info.vertices = scene.positions.size();
  if (scene.instancing) {
    info.instances = scene.instancing->instances.size();
    info.instanced_meshes = scene.instancing->ranges.size();
    info.instanced_triangles_kept = scene.instancing->meshes->triangles.size();
    info.instanced_triangles_shown = scene.instancing->triangles;
    info.objects += info.instances;
  }
  info.lights_placed = scene.lights.size();
  info.textures = scene.textures.size();
  info.texels = scene.texels.size();
  info.bytes = scene.bytes();
  info.bounds = scene.bounds;
  for (const Camera& camera : scene.cameras) {
    SceneInfo::CameraEntry entry;
    entry.name = camera.name;
    entry.type = camera.type == CameraType::perspective    ? "perspective"
                 : camera.type == CameraType::orthographic ? "orthographic"
                                                           : "pinhole";
    if (camera.type == CameraType::perspective) entry.yfov = camera.yfov;
    if (camera.type == CameraType::orthographic) {
      entry.xmag = camera.xmag;
      entry.ymag = camera.ymag;
    }
    entry.znear = camera.znear;
    entry.zfar = camera.zfar;
    const kernels::Vec3 axis = make_ray_camera(camera, 1, 1).axis;
    for (int c = 0; c < 3; ++c) {
      entry.eye[c] = camera.matrix[3][c];
      entry.direction[c] = axis[c];
    }
    info.cameras.push_back(entry);
  }
}

SceneInfo::MeshEntry mesh_entry(const Model& model, std::size_t index,
                                const std::vector<std::uint64_t>& instances) {
  SceneInfo::MeshEntry entry;
  entry.name = name_of(model.meshes, index, "mesh");
  entry.instances = instances[index];
  std::set<std::string> attributes;
  for (const tinygltf::Primitive& primitive : model.meshes[index].primitives) {
    ++entry.primitives;
    entry.morph_targets = std::max<std::uint64_t>(entry.morph_targets, primitive.targets.size());
    for (const auto& [name, accessor] : primitive.attributes) attributes.insert(name);
    if (!has_triangles(primitive.mode)) {
      ++entry.points_and_lines;
      continue;
    }
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) continue;
    const std::uint64_t vertices = model.accessors[position->second].count;
    entry.vertices += vertices;
    entry.triangles += triangle_count(primitive.mode, primitive.indices >= 0
                                                          ? model.accessors[primitive.indices].count
                                                          : vertices);
  }
  entry.attributes.assign(attributes.begin(), attributes.end());
  return entry;
}

void collect_meshes(const Model& model, SceneInfo& info) {
  std::vector<std::uint64_t> instances(model.meshes.size(), 0);
  for (const tinygltf::Node& node : model.nodes) {
    if (node.mesh >= 0) ++instances[node.mesh];
  }
  for (std::size_t i = 0; i < model.meshes.size(); ++i) {
    info.meshes.push_back(mesh_entry(model, i, instances));
  }
}

SceneInfo::MaterialEntry material_entry(const Model& model, std::size_t index) {
  const tinygltf::Material& material = model.materials[index];
  SceneInfo::MaterialEntry entry;
  entry.name = name_of(model.materials, index, "material");
  entry.alpha_mode = material.alphaMode;
  entry.double_sided = material.doubleSided;
  entry.unlit = material.extensions.contains("KHR_materials_unlit");
  const auto& pbr = material.pbrMetallicRoughness;
  for (const int texture : {pbr.baseColorTexture.index, pbr.metallicRoughnessTexture.index,
                            material.normalTexture.index, material.occlusionTexture.index,
                            material.emissiveTexture.index}) {
    entry.textures += texture >= 0;
  }
  for (const auto& [name, value] : material.extensions) entry.extensions.push_back(name);
  return entry;
}

SceneInfo::LightEntry light_entry(const Model& model, std::size_t index) {
  const tinygltf::Light& light = model.lights[index];
  SceneInfo::LightEntry entry;
  entry.name = name_of(model.lights, index, "light");
  entry.type = light.type;
  for (std::size_t c = 0; c < 3; ++c) {
    entry.color[c] = c < light.color.size() ? light.color[c] : 1.0;
  }
  entry.intensity = light.intensity;
  entry.range = light.range > 0.0 ? light.range : std::numeric_limits<double>::infinity();
  return entry;
}

SceneInfo::AnimationEntry animation_entry(const gltf::Document& document, std::size_t index) {
  const Model& model = document.model;
  const tinygltf::Animation& animation = model.animations[index];
  SceneInfo::AnimationEntry entry;
  entry.name = name_of(model.animations, index, "animation");
  entry.channels = animation.channels.size();
  std::set<std::string> paths;
  std::set<int> nodes;
  for (const auto& channel : animation.channels) {
    const auto& sampler = animation.samplers[channel.sampler];
    paths.insert(channel.target_path);
    entry.targets.push_back({channel.target_node, channel.target_path, sampler.interpolation,
                             model.accessors[sampler.input].count});
    if (channel.target_node >= 0) nodes.insert(channel.target_node);
  }
  entry.nodes = nodes.size();
  entry.paths.assign(paths.begin(), paths.end());
  // Key times ascend and their accessors must state min and max; the data itself need not be read.
  bool first = true;
  for (const auto& sampler : animation.samplers) {
    const tinygltf::Accessor& times = model.accessors[sampler.input];
    if (times.minValues.empty() || times.maxValues.empty()) continue;
    entry.start = first ? times.minValues[0] : std::min(entry.start, times.minValues[0]);
    entry.end = first ? times.maxValues[0] : std::max(entry.end, times.maxValues[0]);
    first = false;
  }
  return entry;
}

void collect_variants(const Model& model, SceneInfo& info) {
  for (std::string& name : gltf::variant_names(model)) info.variants.push_back({std::move(name)});
  for (const tinygltf::Mesh& mesh : model.meshes) {
    for (const tinygltf::Primitive& primitive : mesh.primitives) {
      for (const auto& [variant, material] : gltf::variant_materials(primitive)) {
        info.variants[variant].primitives += material != primitive.material;
      }
    }
  }
}

void collect_extensions(const Model& model, SceneInfo& info) {
  const std::set<std::string> required(model.extensionsRequired.begin(),
                                       model.extensionsRequired.end());
  std::set<std::string> all = required;
  all.insert(model.extensionsUsed.begin(), model.extensionsUsed.end());
  const auto honoured = gltf::supported_extensions();
  for (const std::string& name : all) {
    info.extensions.push_back(
        {name, required.contains(name),
         std::find(honoured.begin(), honoured.end(), name) != honoured.end()});
  }
}

}  // namespace

SceneInfo collect_info(const gltf::Document& document, const Scene& scene) {
  const Model& model = document.model;
  SceneInfo info;
  info.source = document.file;
  info.version = model.asset.version;
  info.generator = model.asset.generator;
  info.copyright = model.asset.copyright;
  info.default_scene = model.defaultScene;
  info.nodes = model.nodes.size();
  std::vector<int> all(model.nodes.size());
  std::iota(all.begin(), all.end(), 0);
  info.hidden_nodes = all.size() - visible_nodes(model, all).size();
  for (std::size_t i = 0; i < model.scenes.size(); ++i) {
    info.scenes.push_back({name_of(model.scenes, i, "scene"), model.scenes[i].nodes.size(),
                           reachable_nodes(model, model.scenes[i].nodes).size()});
  }
  collect_meshes(model, info);
  for (std::size_t i = 0; i < model.materials.size(); ++i) {
    info.materials.push_back(material_entry(model, i));
  }
  for (std::size_t i = 0; i < model.lights.size(); ++i) {
    info.lights.push_back(light_entry(model, i));
  }
  for (std::size_t i = 0; i < model.animations.size(); ++i) {
    info.animations.push_back(animation_entry(document, i));
  }
  for (std::size_t i = 0; i < model.skins.size(); ++i) {
    info.skins.push_back({name_of(model.skins, i, "skin"), model.skins[i].joints.size()});
  }
  for (std::size_t i = 0; i < document.images.size(); ++i) {
    const gltf::EncodedImage& image = document.images[i];
    std::string name = name_of(model.images, i, "image");
    if (model.images[i].name.empty() && !image.uri.empty()) name = image.uri;
    info.images.push_back({std::move(name), image.mime, image.bytes.size()});
  }
  collect_variants(model, info);
  collect_extensions(model, info);
  collect_flattened(scene, info);
  return info;
}

SceneInfo collect_info(std::string_view builtin_name, const Scene& scene) {
  SceneInfo info;
  info.source = fmt::format("builtin:{}", builtin_name);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const kernels::Material& material = scene.materials[i];
    SceneInfo::MaterialEntry entry;
    entry.name = scene.material_names[i];
    entry.alpha_mode = material.alpha_mode == kernels::AlphaMode::opaque ? "OPAQUE"
                       : material.alpha_mode == kernels::AlphaMode::mask ? "MASK"
                                                                         : "BLEND";
    entry.double_sided = material.double_sided != 0;
    entry.unlit = material.unlit != 0;
    for (const auto* ref :
         {&material.base_color_texture, &material.metallic_roughness_texture,
          &material.normal_texture, &material.occlusion_texture, &material.emissive_texture}) {
      entry.textures += ref->texture != kernels::kNone;
    }
    info.materials.push_back(std::move(entry));
  }
  collect_flattened(scene, info);
  return info;
}

}  // namespace octrace::scene
