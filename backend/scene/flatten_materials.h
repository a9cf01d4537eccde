// glTF materials and their textures as the renderer's records.
#pragma once

#include "backend/gltf/document.h"
#include "backend/scene/flatten.h"
#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::scene {

// Fills materials, material_names, textures and texels. `default_material` appends glTF's default
// material, for primitives that name none; it is also there where the file has no material.
util::Result<void> place_materials(const gltf::Document& document, const FlattenOptions& options,
                                   bool default_material, Scene& scene);

}  // namespace octrace::scene
