// Ways to break the base scene by one JSON Patch (RFC 6902) each, and what load() must say.
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace octrace::tests {

struct PatchCase {
  std::string name;
  std::string patch;
  std::string code;     // the Khronos validator's, or LIMIT
  std::string pointer;  // exactly
  int exit = 3;
};

inline void PrintTo(const PatchCase& broken, std::ostream* stream) { *stream << broken.patch; }

std::vector<PatchCase> patch_cases();

}  // namespace octrace::tests
