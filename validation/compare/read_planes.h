// Reads the planes of an image file, whichever program wrote it.
#pragma once

#include <string>

#include "backend/util/limits.h"
#include "validation/compare/planes.h"
#include "validation/compare/tolerances.h"

namespace octrace::validation {

enum class Writer { unknown, povray, blender };

struct PlanesFile {
  Planes planes;
  Writer writer = Writer::unknown;
};

// STEM.png beside a STEM.json that octrace export wrote in depth mode is POV-Ray's encoded depth;
// channels named as in ViewLayer.Depth.Z are Blender's. Errors: exit 5 where a file cannot be read,
// exit 3 where it does not hold what is needed.
util::Result<PlanesFile> read_planes(const std::string& path, const util::Limits& limits);

const Tolerances& tolerances_for(Writer writer);
const char* writer_name(Writer writer);

}  // namespace octrace::validation
