// Animated scenes of the project's own, each made to be hard on one part of the specification.
#pragma once

#include <string>
#include <vector>

#include "tests/unit/scene_support.h"

namespace octrace::tests {

struct AnimatedScene {
  std::string name;
  scene::testing::GltfFile file;
};

// Paths and interpolations on a hierarchy; rotations; a skin of two joint sets; morph targets;
// a skin with morph targets and a moving camera; instances.
std::vector<AnimatedScene> animated_scenes();

}  // namespace octrace::tests
