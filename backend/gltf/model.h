// A checked JSON tree becomes a tinygltf::Model, by tinygltf itself.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "backend/gltf/issues.h"
#include "backend/gltf/json_text.h"
#include "backend/gltf/tinygltf.h"

namespace octrace::gltf {

// Where a buffer's or image's bytes come from. tinygltf never sees these: it would open files by
// rules of its own, and copy data URIs several times.
struct Source {
  std::string uri;                // empty: none given
  std::uint64_t byte_length = 0;  // buffers only
};

// A buffer view's EXT_meshopt_compression: where its compressed bytes are, and what they become.
struct MeshoptView {
  enum class Mode { attributes, triangles, indices };
  enum class Filter { none, octahedral, quaternion, exponential };
  std::size_t view = 0;    // index into bufferViews
  std::size_t buffer = 0;  // of the compressed bytes
  std::uint64_t byte_offset = 0, byte_length = 0;
  std::uint64_t byte_stride = 0, count = 0;  // decoded: byte_stride * count bytes
  Mode mode = Mode::attributes;
  Filter filter = Filter::none;
};

// A primitive's KHR_draco_mesh_compression.
struct DracoPrimitive {
  std::size_t mesh = 0, primitive = 0;
  std::size_t view = 0;                             // of the compressed bytes
  std::map<std::string, std::uint32_t> attributes;  // unique ids in the Draco stream, by semantic
};

struct Structure {
  tinygltf::Model model;  // buffers without data, images without pixels
  std::vector<Source> buffers, images;
  std::vector<bool> fallback_buffers;  // by buffer: stands in for compressed views only
  std::vector<MeshoptView> meshopt;    // by view
  std::vector<DracoPrimitive> draco;   // by mesh, then by primitive
};

// `root` has passed check_structure.
Structure make_model(Json root, Issues& issues);

}  // namespace octrace::gltf
