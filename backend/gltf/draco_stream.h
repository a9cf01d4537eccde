// One Draco stream, decoded by libdraco with its memory bounded before it is taken.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "backend/util/result.h"

namespace draco {
class Mesh;
}

namespace octrace::gltf {

struct DracoBounds {
  std::uint64_t max_faces = 0;   // as many as the primitive's indices make
  std::uint64_t max_points = 0;  // as many as its accessors have elements
  std::uint64_t max_bytes = 0;   // of all decoded attributes
};

// Draco's Mesh may only be deleted where its header is known.
struct DracoMeshDeleter {
  void operator()(draco::Mesh* mesh) const;
};
using DracoMesh = std::unique_ptr<draco::Mesh, DracoMeshDeleter>;

// Streams of more faces a byte are refused, so that a few bytes cannot ask for gigabytes. A flat
// grid of 180,000 faces reaches 16.
inline constexpr std::uint64_t kDracoFacesPerByte = 1024;

// Errors: DRACO_DATA_INVALID (exit 3), unsupported (another bitstream than the extension's 2.2),
// LIMIT (exit 6), all without file and pointer.
util::Result<DracoMesh> decode_draco_stream(std::span<const std::uint8_t> bytes,
                                            const DracoBounds& bounds);

}  // namespace octrace::gltf
