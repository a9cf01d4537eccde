// --camera: which camera a render looks through.
#pragma once

#include <string>

#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::batch {

// Empty: the scene's first camera, or one that frames its bounds. A name ending in .json: a camera
// file. Else a camera's name, else its index in the scene. Usage errors list what there is.
util::Result<scene::Camera> choose_camera(const std::string& choice, const scene::Scene& scene,
                                          double aspect);

// The text of a camera file (--camera FILE.json) that gives the same camera.
std::string camera_json(const scene::Camera& camera);

}  // namespace octrace::batch
