// What `octrace info` reports about a scene: the file's own structure, and what it flattens to.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/scene.h"

namespace octrace::scene {

struct SceneInfo {
  struct SceneEntry {
    std::string name;
    std::uint64_t roots = 0, nodes = 0;  // nodes: all that its roots reach
  };
  struct CameraEntry {
    std::string name;
    std::string type;                       // perspective, orthographic, pinhole
    double yfov = 0.0;                      // perspective: radians
    double xmag = 0.0, ymag = 0.0;          // orthographic
    double znear = 0.0, zfar = 0.0;         // zfar may be +infinity
    double eye[3] = {}, direction[3] = {};  // world
  };
  struct MeshEntry {
    std::string name;
    std::uint64_t primitives = 0;
    std::uint64_t triangles = 0;         // of one instance
    std::uint64_t vertices = 0;          // of one instance
    std::uint64_t points_and_lines = 0;  // primitives that octrace leaves out
    std::uint64_t morph_targets = 0;
    std::uint64_t instances = 0;          // nodes that name it, in all scenes
    std::vector<std::string> attributes;  // POSITION, NORMAL, ... of all its primitives, sorted
  };
  struct MaterialEntry {
    std::string name;
    std::string alpha_mode;  // OPAQUE, MASK, BLEND
    bool double_sided = false, unlit = false;
    std::uint64_t textures = 0;
    std::vector<std::string> extensions;  // that the material itself uses
  };
  struct LightEntry {
    std::string name;
    std::string type;                                    // directional, point, spot
    double color[3] = {}, intensity = 0.0, range = 0.0;  // range +infinity: none
  };
  struct AnimationEntry {
    std::string name;
    std::uint64_t channels = 0;
    double start = 0.0, end = 0.0;   // seconds
    std::vector<std::string> paths;  // translation, rotation, scale, weights; sorted
    struct Target {
      int node = -1;  // -1: an extension's own target, which is left out
      std::string path, interpolation;
      std::uint64_t keys = 0;
    };
    std::vector<Target> targets;  // by channel
    std::uint64_t nodes = 0;      // that some channel moves
  };
  struct SkinEntry {
    std::string name;
    std::uint64_t joints = 0;
  };
  struct ImageEntry {
    std::string name;  // its uri where it has no name
    std::string mime;
    std::uint64_t bytes = 0;  // as encoded
  };
  struct VariantEntry {  // KHR_materials_variants
    std::string name;
    std::uint64_t primitives = 0;  // that it gives a material of its own
  };
  struct ExtensionEntry {
    std::string name;
    bool required = false, honoured = false;
  };

  // The file (empty for built-in scenes, which have neither nodes nor animations).
  std::string source;  // file name or "builtin:NAME"
  std::string version, generator, copyright;
  int default_scene = -1;
  std::uint64_t nodes = 0;
  std::uint64_t hidden_nodes = 0;  // by KHR_node_visibility, their own or a parent's
  std::vector<SceneEntry> scenes;
  std::vector<CameraEntry> cameras;  // as placed in the flattened scene, in its order
  std::vector<MeshEntry> meshes;
  std::vector<MaterialEntry> materials;
  std::vector<LightEntry> lights;  // as defined, not as placed
  std::vector<AnimationEntry> animations;
  std::vector<SkinEntry> skins;
  std::vector<ImageEntry> images;
  std::vector<VariantEntry> variants;
  std::vector<ExtensionEntry> extensions;  // used and required ones, sorted by name

  // The flattened scene, every node counted.
  std::uint64_t objects = 0;                  // nodes that carry triangles
  std::uint64_t geometries = 0;               // primitives of nodes
  std::uint64_t triangles = 0, vertices = 0;  // without those of instances
  // Of EXT_mesh_gpu_instancing: meshes and their triangles as kept, once each, and as shown.
  std::uint64_t instances = 0, instanced_meshes = 0;
  std::uint64_t instanced_triangles_kept = 0, instanced_triangles_shown = 0;
  std::uint64_t lights_placed = 0, textures = 0, texels = 0;
  std::uint64_t bytes = 0;  // in memory, without the octree
  Bounds bounds;
};

SceneInfo collect_info(const gltf::Document& document, const Scene& scene);
SceneInfo collect_info(std::string_view builtin_name, const Scene& scene);

}  // namespace octrace::scene
