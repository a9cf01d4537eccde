// The GLB container: header and chunks, glTF 2.0 specification section 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "backend/gltf/issues.h"

namespace octrace::gltf {

struct GlbChunks {
  std::string_view json;
  struct Range {
    std::size_t offset = 0, size = 0;
  };
  std::optional<Range> bin;  // within the file
};

bool has_glb_magic(std::span<const std::uint8_t> bytes);

// Errors: the validator's GLB_ codes, with an empty JSON pointer.
GlbChunks parse_glb(std::span<const std::uint8_t> bytes, Issues& issues);

}  // namespace octrace::gltf
