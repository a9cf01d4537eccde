// EXT_meshopt_compression, decoded by meshoptimizer.
#pragma once

#include "backend/gltf/issues.h"
#include "backend/gltf/model.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

// Needs the buffers. Afterwards every compressed buffer view shows a buffer of its own, appended to
// the model's, that holds its decoded bytes. Errors: MESHOPT_DATA_INVALID, LIMIT
// (--max-scene-bytes).
void decode_meshopt(Structure& structure, const util::Limits& limits, Issues& issues);

}  // namespace octrace::gltf
