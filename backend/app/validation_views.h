// What `octrace validate` looks at: cameras for a scene, and octrace's own image of each.
#pragma once

#include <string>
#include <vector>

#include "backend/app/options.h"
#include "backend/octree/octree.h"
#include "backend/render/device.h"
#include "backend/scene/scene.h"
#include "validation/compare/planes.h"

namespace octrace::app {

struct ValidationView {
  scene::Camera camera;
  validation::Planes planes;
};

struct ViewOptions {
  std::string camera = "ALL";  // ALL, or as --camera of render
  ImageSize size{640, 480};
  bool cull = true, alpha = true;
  unsigned threads = 0;
  render::DeviceChoice device;
};

// The mask, depth and object ids that octrace sees through a camera.
util::Result<validation::Planes> render_planes(const scene::Scene& scene,
                                               const octree::Octree& octree,
                                               const scene::Camera& camera,
                                               const ViewOptions& options);

// ALL: the scene's cameras; of a scene that has none, the first three of some framings (from the
// front, from behind, from below, ...) that show anything of it, because single-sided surfaces are
// not there from behind. Cameras of the same name get their index added.
util::Result<std::vector<ValidationView>> render_views(const scene::Scene& scene,
                                                       const octree::Octree& octree,
                                                       const ViewOptions& options);

}  // namespace octrace::app
