// glTF files taken apart, their geometry encoded, and put together again.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/gltf/document.h"

namespace octrace::tests {

using Bytes = std::vector<std::uint8_t>;

// A glTF file of one buffer.
struct Parts {
  nlohmann::json root;
  Bytes bin;

  Bytes glb() const;
  int append_view(const Bytes& bytes);  // returns its index
};

// A built-in scene as `octrace export --to gltf` writes it.
Parts parts_of_builtin(const std::string& name);
// A file on disk. Its images become one white pixel, since what the result is read from has no
// folder.
Parts parts_of_file(const std::string& path);

struct MeshoptOptions {
  bool triangles = true;  // index lists as TRIANGLES, which may turn a triangle's corners
};
// Compresses every buffer view that a mode fits, in place; what remains is a fallback buffer
// without data. Returns how many views were compressed.
int meshopt_encode(Parts& parts, const MeshoptOptions& options);

enum class DracoMethod { sequential, edgebreaker };
enum class DracoValues { exact, quantised };
// Primitives of other modes than TRIANGLES and, under edgebreaker, which reorders vertices, morphed
// ones stay as they are. Quantised positions and texture coordinates are also predicted as far as
// libdraco can. Returns how many primitives were compressed.
int draco_encode(Parts& parts, DracoMethod method, DracoValues values = DracoValues::exact);

void use_extension(nlohmann::json& root, const std::string& name, bool required = true);

}  // namespace octrace::tests
