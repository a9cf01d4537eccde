// KHR_draco_mesh_compression.
#pragma once

#include "backend/gltf/issues.h"
#include "backend/gltf/model.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

// Needs the buffers, with meshopt's views decoded, and all links checked. Afterwards every
// compressed primitive names accessors of its own, appended to the model's with a view and a buffer
// each, that hold its decoded attributes and indices; what its former accessors hold is for others
// to use. Errors: DRACO_DATA_INVALID, DRACO_VERSION (unsupported), LIMIT (--max-scene-bytes).
void decode_draco(Structure& structure, const util::Limits& limits, Issues& issues);

}  // namespace octrace::gltf
