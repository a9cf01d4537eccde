// Checks of the numbers inside accessors.
#pragma once

#include "backend/gltf/issues.h"
#include "backend/gltf/tinygltf.h"

namespace octrace::gltf {

// Needs all links checked and all buffers loaded. Afterwards every float is finite, every index and
// joint is in range, sparse indices and animation times increase.
void check_data(const tinygltf::Model& model, Issues& issues);

}  // namespace octrace::gltf
