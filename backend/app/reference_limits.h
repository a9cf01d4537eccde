// What Blender's glTF importer cannot show of a scene as the file has it: the cause that an
// exception is listed with. Measured with the add-on 3.4.50 of Blender 3.4.1.
#pragma once

#include <string>
#include <vector>

#include "backend/batch/scene_session.h"
#include "backend/util/result.h"

namespace octrace::app {

// One line each; empty where nothing is known.
struct ReferenceLimits {
  std::vector<std::string> shown_otherwise;  // the image may differ
  std::vector<std::string> refused;          // there is no image
};

// Errors: those of reading the file.
util::Result<ReferenceLimits> blender_limits(const batch::SceneRequest& request,
                                             const scene::Scene& scene);

}  // namespace octrace::app
