// The bytes that a glTF file refers to: its buffers and images.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/gltf/files.h"
#include "backend/gltf/issues.h"
#include "backend/gltf/model.h"

namespace octrace::gltf {

// Fills model.buffers[].data with exactly byteLength bytes each, but for those that compressed
// views replace. `bin` is a GLB's second chunk.
void load_buffers(Structure& structure, std::optional<std::vector<std::uint8_t>> bin,
                  const SceneFolder& folder, const util::Limits& limits, Issues& issues);

// Needs the buffers. One EncodedImage for each image of the file, in order.
std::vector<EncodedImage> load_images(const Structure& structure, const SceneFolder& folder,
                                      const LoadOptions& options, Issues& issues);

}  // namespace octrace::gltf
