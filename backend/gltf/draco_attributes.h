// Bounds on what a Draco stream's attributes ask for that libdraco itself does not check.
#pragma once

#include <optional>

#include "backend/util/result.h"

namespace draco {
class MeshDecoder;
}

namespace octrace::gltf {

// To be called once a group of attributes has got its decoder, which is replaced by one that does
// the same but stops, with `error` set, where a count is more than the mesh has use for. Both
// outlive the decoding. False where the decoder is of no known kind.
bool bound_attributes(draco::MeshDecoder& decoder, int group, std::optional<util::Error>& error);

}  // namespace octrace::gltf
