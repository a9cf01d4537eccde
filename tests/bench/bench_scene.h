// The scene that a benchmark names, without any image library: textures are not decoded.
#pragma once

#include <string>

#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::bench {

util::Result<scene::Scene> load_scene(const std::string& name);

// The named camera, the first one, or one that frames the bounds.
util::Result<scene::Camera> choose_camera(const scene::Scene& scene, const std::string& name,
                                          double aspect);

}  // namespace octrace::bench
