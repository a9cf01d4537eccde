// Scenes that come with the program: builtin:default, builtin:paper, builtin:terrain, builtin:soup.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::scene {

inline constexpr std::string_view kBuiltinPrefix = "builtin:";

std::vector<std::string> builtin_names();

// By name without the prefix. terrain and soup take a size after a colon: quads a side (default
// 1024) and triangles (default 1,000,000). Unknown names and bad sizes are usage errors.
util::Result<Scene> make_builtin(std::string_view name, const util::Limits& limits = {});

// The scenes themselves. The same bits on every machine: see exact_math.h.
Scene make_default_scene();
Scene make_paper_scene();
Scene make_terrain_scene(std::uint32_t quads_a_side);
Scene make_soup_scene(std::uint32_t triangles);

}  // namespace octrace::scene
