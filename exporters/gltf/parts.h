// The pieces that a .glb is put together from.
#pragma once

#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"
#include "exporters/gltf/glb_builder.h"
#include "exporters/text.h"

namespace octrace::exporters {

struct GltfJob {
  const scene::Scene& scene;
  std::string folder;  // of the file, where the image library may leave a temporary one
  GlbBuilder glb;
  std::vector<std::string> notes;

  void note(const std::string& line) {  // once
    for (const std::string& known : notes) {
      if (known == line) return;
    }
    notes.push_back(line);
  }
};

util::Result<void> append_materials(GltfJob& job);  // images, samplers, textures, materials
void append_nodes(GltfJob& job);                    // meshes, nodes, cameras, lights, the scene

// The texture coordinate sets that a material asks for: 0, 1 or 2.
int texcoord_sets(const kernels::Material& material);

// One mesh of the geometries (indices into the scene's) of one object.
int append_mesh(GltfJob& job, std::uint32_t object, const std::vector<std::uint32_t>& geometries);

}  // namespace octrace::exporters
