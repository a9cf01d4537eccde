// URIs in a glTF file (RFC 3986, RFC 2397): embedded data, or a file in the scene's folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::gltf {

struct DataUri {
  std::string mime;  // lower case; empty where none is given
  std::vector<std::uint8_t> bytes;
};

bool is_data_uri(std::string_view uri);

// Error: INVALID_URI, without file and pointer.
util::Result<DataUri> decode_data_uri(std::string_view uri);

// The path of a file, percent-decoded, with '/' between its parts and no part that is empty, "."
// or ".."; it names something in or below the scene's folder as far as its text tells. Errors:
// INVALID_URI (bad escape, control character, leaves the folder), NON_RELATIVE_URI (a scheme, a
// host, an absolute path).
util::Result<std::string> relative_path(std::string_view uri);

}  // namespace octrace::gltf
