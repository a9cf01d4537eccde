#include "backend/app/time_options.h"

#include <cmath>

namespace octrace::app {

scene::Time TimeOptions::time() const {
  if (animation == "none") return {};
  if (seconds) return seconds;
  if (frame) return scene::frame_time(static_cast<double>(*frame), fps);
  return animation.empty() ? scene::Time() : scene::Time(0.0);
}

// From the frame's number where there is one, so that it is the very time of that frame.
scene::Time TimeOptions::next() const {
  const scene::Time now = time();
  if (!now) return now;
  if (frame) return scene::frame_time(static_cast<double>(*frame) + 1.0, fps);
  return *now + 1.0 / fps;
}

void add_time_options(CLI::App& command, TimeOptions& options) {
  const auto finite = [](const std::string& text) {
    double value = 0.0;
    return CLI::detail::lexical_cast(text, value) && std::isfinite(value)
               ? std::string()
               : "a finite number is needed, not '" + text + "'";
  };
  constexpr const char* kGroup = "Time (without these the scene is at rest, as the file has it)";
  CLI::Option* time =
      command.add_option("--time", options.seconds, "the animation at this time, in seconds")
          ->check(finite)
          ->type_name("SECONDS")
          ->group(kGroup);
  command.add_option("--frame", options.frame, "the same at N / fps seconds")
      ->check(CLI::Range(-(std::int64_t{1} << 53), std::int64_t{1} << 53).description(""))
      ->excludes(time)
      ->type_name("N")
      ->group(kGroup);
  command
      .add_option("--fps", options.fps,
                  "frames a second, for --frame and for the motion to the next frame [24]")
      ->check(CLI::Range(1e-3, 1e6).description(""))
      ->type_name("F")
      ->group(kGroup);
  command
      .add_option("--animation", options.animation,
                  "which animation; none: rest whatever the time [the first]")
      ->type_name("NAME|INDEX|none")
      ->group(kGroup);
}

void set_time(const TimeOptions& options, batch::SceneRequest& request) {
  request.time = options.time();
  request.animation = options.animation;
}

}  // namespace octrace::app
