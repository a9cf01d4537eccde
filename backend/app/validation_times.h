// The moments at which octrace validate looks at a scene.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "backend/app/time_options.h"

namespace octrace::app {

struct ValidationTime {
  std::string animation;  // as --animation takes it
  scene::Time seconds;
  std::string label;  // for a comparison's name; empty: there is one moment only
};

// Without `keys` the one that the options name. With it that many key times, 0: all, of each
// animation that the options leave: those at which every channel has a key, which is where other
// programs have glTF's values. Once at rest where nothing is animated.
util::Result<std::vector<ValidationTime>> validation_times(const batch::SceneRequest& request,
                                                           const TimeOptions& options,
                                                           std::optional<int> keys);

}  // namespace octrace::app
