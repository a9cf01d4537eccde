// Which reference program this is, for the report.
#pragma once

#include <string>

#include "backend/util/result.h"

namespace octrace::validation {

struct ProgramVersion {
  std::string path;  // where it was found
  std::string text;  // the line of --version that names it, e.g. "Blender 3.4.1"
};

// Errors: exit 4 where it is not found, exit 5 where --version fails.
util::Result<ProgramVersion> program_version(const std::string& program);

}  // namespace octrace::validation
