// Limits on what an input may ask for. Each is an option of the command line (--max-...), checked
// before memory is taken; the error (exit 6) names the option.
#pragma once

#include <cstdint>

namespace octrace::util {

struct Limits {
  std::uint64_t max_file_bytes = 16ull << 30;     // --max-file-bytes: any one file read
  std::uint64_t max_json_bytes = 256ull << 20;    // --max-json-bytes: the JSON part of a glTF
  std::uint64_t max_json_depth = 128;             // --max-json-depth: nesting of JSON values
  std::uint64_t max_scene_bytes = 64ull << 30;    // --max-scene-bytes: flattened scene and octree
  std::uint64_t max_triangles = 1ull << 30;       // --max-triangles: flattened, below 2^31
  std::uint64_t max_nodes = 1ull << 24;           // --max-nodes: glTF nodes in a file
  std::uint64_t max_instances = 1ull << 24;       // --max-instances: of EXT_mesh_gpu_instancing
  std::uint64_t max_texture_pixels = 1ull << 28;  // --max-texture-pixels: one image, width * height
  std::uint64_t max_image_pixels = 1ull << 28;    // --max-image-pixels: the rendered image
  std::uint64_t max_spp = 1ull << 16;             // --max-spp
  std::uint64_t max_views = 10'000'000;           // --max-views: of a batch, in all its shards
};

}  // namespace octrace::util
