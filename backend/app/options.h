// Options that several commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "backend/app/scene_session.h"
#include "backend/util/limits.h"

namespace octrace::app {

// SCENE, --scene, --missing-images, --builder, --leaf, --threads, --verify, --max-...
void add_scene_options(CLI::App& command, SceneRequest& request);
void add_limit_options(CLI::App& command, util::Limits& limits);
void add_verbosity_options(CLI::App& command);  // --quiet, --verbose

struct ImageSize {
  std::uint32_t width = 1280, height = 720;
};
// "640x480". Usage errors; exit 6 past --max-image-pixels.
util::Result<ImageSize> parse_size(const std::string& text, const util::Limits& limits);

util::Error usage_error(const std::string& message);

}  // namespace octrace::app
