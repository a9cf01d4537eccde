// Every property that octrace or tinygltf reads has the right JSON type, lies in its range, and
// refers to something that exists. Relations between objects are links.h's business.
#pragma once

#include <cstddef>

#include "backend/gltf/json_ref.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

// Lengths of the top-level arrays, which indices are checked against.
struct Sizes {
  std::size_t accessors = 0, animations = 0, buffers = 0, buffer_views = 0, cameras = 0, images = 0,
              lights = 0, materials = 0, meshes = 0, nodes = 0, samplers = 0, scenes = 0, skins = 0,
              textures = 0, variants = 0;
};

void check_structure(const JsonRef& root, const util::Limits& limits);

// The parts of check_structure, one a file.
void check_asset(const JsonRef& root);
void check_extension_lists(const JsonRef& root);
void check_buffers(const JsonRef& root, const Sizes& sizes);  // and buffer views
void check_accessors(const JsonRef& root, const Sizes& sizes);
void check_compression(const JsonRef& root, const Sizes& sizes);  // after buffers and meshes
void check_images(const JsonRef& root, const Sizes& sizes);       // and textures, samplers
void check_materials(const JsonRef& root, const Sizes& sizes);
void check_meshes(const JsonRef& root, const Sizes& sizes);
void check_variants(const JsonRef& root, const Sizes& sizes);  // after meshes
void check_nodes(const JsonRef& root, const Sizes& sizes);     // and scenes, skins
void check_hierarchy(const JsonRef& root);                     // after check_nodes
void check_cameras(const JsonRef& root);                       // and lights
void check_animations(const JsonRef& root, const Sizes& sizes);

// The properties of every glTF object: name and extensions. Returns the (present or absent) object.
void check_common(const JsonRef& object);

// fn(const JsonRef&) for each object of a top-level array.
template <class Fn>
void each_object(const JsonRef& root, std::string_view key, Fn fn) {
  const JsonRef array = root.member(key);
  array.each_element([&](std::size_t, const JsonRef& element) { fn(element); });
}

}  // namespace octrace::gltf
