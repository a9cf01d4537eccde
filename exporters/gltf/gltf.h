// A flattened scene -> one binary glTF 2.0 file (.glb) in which every transform, skin and morph
// target is baked into the vertices.
#pragma once

#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::exporters {

struct GltfFile {
  std::uint64_t bytes = 0;
  std::vector<std::string> notes;  // what glTF cannot express, one line each
};

// Node i is object i, named after it and without a transform; nodes of cameras and lights follow.
// Triangles keep their order, so that object and primitive ids stay the same when octrace reads the
// file. The Khronos validator finds no error in it.
util::Result<GltfFile> write_gltf(const scene::Scene& scene, const std::string& path);

}  // namespace octrace::exporters
