// Cameras and lights, which stand at nodes.
#pragma once

#include <glm/mat4x4.hpp>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/scene.h"
#include "backend/util/result.h"

namespace octrace::scene {

// In node order, named by the node, else by the camera. `nodes`: those of the scene, ascending.
util::Result<void> place_cameras(const gltf::Document& document, const std::vector<int>& nodes,
                                 const std::vector<glm::dmat4>& worlds, Scene& scene);

// KHR_lights_punctual. A node's scale changes no light.
util::Result<void> place_lights(const gltf::Document& document, const std::vector<int>& nodes,
                                const std::vector<glm::dmat4>& worlds, Scene& scene);

}  // namespace octrace::scene
