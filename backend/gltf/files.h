// Reading files that an input names: regular files only, within a limit, and never outside the
// scene's folder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::gltf {

// At most max_bytes may be there (exit 6, names --max-file-bytes); at most `wanted` are read.
// Errors: IO_ERROR (exit 5) for a missing or unreadable file, and for one that is not regular.
util::Result<std::vector<std::uint8_t>> read_regular_file(
    const std::string& path, std::uint64_t max_bytes,
    std::uint64_t wanted = static_cast<std::uint64_t>(-1));

class SceneFolder {
 public:
  // The folder that holds the scene's file. None (for a scene in memory) refuses every file.
  static SceneFolder of(const std::string& scene_path);
  static SceneFolder none() { return {}; }

  // `relative` comes from relative_path(). Symbolic links are followed as long as they stay below
  // the folder; else INVALID_URI.
  util::Result<std::vector<std::uint8_t>> read(
      const std::string& relative, std::uint64_t max_bytes,
      std::uint64_t wanted = static_cast<std::uint64_t>(-1)) const;

 private:
  std::string canonical_;  // without symbolic links; empty: no folder
};

}  // namespace octrace::gltf
