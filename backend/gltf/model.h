// A checked JSON tree becomes a tinygltf::Model, by tinygltf itself.
#pragma once

#include <cstdint>
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

struct Structure {
  tinygltf::Model model;  // buffers without data, images without pixels
  std::vector<Source> buffers, images;
};

// `root` has passed check_structure.
Structure make_model(Json root, Issues& issues);

}  // namespace octrace::gltf
