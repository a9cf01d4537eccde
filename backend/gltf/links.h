// Relations between a checked file's objects that need no buffer's bytes: accessors fit their
// views, attributes and animations have glTF's formats and equal counts.
#pragma once

#include "backend/gltf/issues.h"
#include "backend/gltf/tinygltf.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

void check_accessor_links(const tinygltf::Model& model, const util::Limits& limits, Issues& issues);
// The others need check_accessor_links to have passed.
void check_mesh_links(const tinygltf::Model& model, Issues& issues);
void check_skin_links(const tinygltf::Model& model, Issues& issues);
void check_animation_links(const tinygltf::Model& model, Issues& issues);

}  // namespace octrace::gltf
