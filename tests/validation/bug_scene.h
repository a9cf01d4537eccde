// A glTF file in which every bug that the validation tests plant shows: an interleaved triangle
// strip, the same from behind, a lopsided closed mesh under a matrix, a mirrored and a plain
// instance of it, all single-sided, and one that its alpha cuts out altogether.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "backend/scene/camera.h"

namespace octrace::validation::test {

enum BugSceneNode {
  kStripNode,
  kMatrixNode,
  kMirroredNode,
  kInstanceNode,
  kBackNode,
  kOrthographicNode
};

nlohmann::json bug_scene();

// Sees all of it, with room for half a pixel's shift.
scene::Camera bug_scene_camera();

}  // namespace octrace::validation::test
