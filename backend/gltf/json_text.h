// From bytes to a JSON tree, within limits of size and depth.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "backend/gltf/issues.h"
#include "backend/util/limits.h"

namespace octrace::gltf {

using Json = nlohmann::json;

// Errors: INVALID_JSON (syntax, UTF-8, numbers beyond double, a root that is no object); a limit
// (size, depth). Returns an empty object after an error.
Json parse_json(std::string_view text, const util::Limits& limits, Issues& issues);

}  // namespace octrace::gltf
