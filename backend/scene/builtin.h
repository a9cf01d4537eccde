// Scenes that come with the program: builtin:default, builtin:paper, builtin:terrain, builtin:soup.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::scene {

inline constexpr std::string_view kBuiltinPrefix = "builtin:";

std::vector<std::string> builtin_names();
util::Result<Scene> make_builtin(std::string_view name);  // without the prefix

}  // namespace octrace::scene
