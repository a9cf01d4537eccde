// Scenes for device tests, without an image library: a texture gets texels of its own size made
// from a hash, which exercises sampling and alpha tests just as well.
#pragma once

#include <memory>
#include <string>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"

namespace octrace::tests {

struct LoadedScene {
  scene::Scene scene;
  octree::Octree octree;
};

// A file or builtin:NAME; a test failure and nullptr where it does not load.
std::unique_ptr<LoadedScene> load_for_device_test(const std::string& source);

scene::Camera first_camera(const scene::Scene& scene, double aspect);

}  // namespace octrace::tests
