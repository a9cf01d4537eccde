// The real scenes that oracles are asked about, loaded as the program loads them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "backend/scene/scene.h"

namespace octrace::tests {

// Paths of every .gltf and .glb under the extra scenes' valid/; empty where the folder is missing.
std::vector<std::string> oracle_scene_files();

struct OracleScene {
  scene::Scene scene;
  octree::Octree octree;
  kernels::SceneView view;  // with the octree
  scene::Camera camera;     // the scene's first, or one that frames it
};

// Adds a test failure and returns nullptr where the scene does not load.
std::unique_ptr<OracleScene> load_oracle_scene(const std::string& file, double aspect);

}  // namespace octrace::tests
