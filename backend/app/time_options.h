// --time, --frame, --fps, --animation.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "backend/batch/scene_session.h"

namespace octrace::app {

struct TimeOptions {
  std::optional<double> seconds;      // --time
  std::optional<std::int64_t> frame;  // --frame
  double fps = scene::kDefaultFps;
  std::string animation;

  // At rest unless a time, a frame or an animation is named; an animation alone starts at 0.
  scene::Time time() const;
  // A frame later, for the motion plane; at rest, rest.
  scene::Time next() const;
};

void add_time_options(CLI::App& command, TimeOptions& options);
void set_time(const TimeOptions& options, batch::SceneRequest& request);

}  // namespace octrace::app
