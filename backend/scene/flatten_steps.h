// The two steps of flatten(), for those who take the second one more than once.
#pragma once

#include <vector>

#include "backend/scene/flatten.h"
#include "backend/scene/flatten_geometry.h"
#include "backend/scene/instances.h"

namespace octrace::scene {

struct ScenePlan {
  std::vector<int> nodes;    // those of the scene, ascending
  std::vector<int> visible;  // those of them that KHR_node_visibility does not hide
  GeometryPlan geometry;     // of visible nodes that are shown once
  InstancePlan instances;    // of the other visible ones
};

// What does not depend on time. Errors as flatten().
util::Result<ScenePlan> plan_scene(const gltf::Document& document, const FlattenOptions& options);

util::Result<Scene> place_scene(const gltf::Document& document, const ScenePlan& plan,
                                const Pose& pose, const FlattenOptions& options, Winding& winding);

}  // namespace octrace::scene
