// The geometry stage of flattening: which primitive of which node goes where in the scene's arrays,
// and filling them from a pose.
#pragma once

#include <cstdint>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/pose.h"
#include "backend/scene/scene.h"
#include "backend/scene/scene_changes.h"
#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::scene {

// Everything that does not depend on the pose: sizes and places in the arrays.
struct GeometryPlan {
  struct Instance {
    int node;
    std::uint32_t geometry;  // index into geometries
  };
  // One primitive of one mesh and the nodes that show it; its data is read from the file once.
  struct Source {
    int mesh, primitive;
    std::vector<Instance> instances;
  };
  std::vector<Source> sources;
  std::vector<kernels::Geometry> geometries;  // by node, then by primitive
  std::uint64_t triangles = 0, vertices = 0;
  std::uint64_t normals = 0, tangents = 0, uvs = 0, colors = 0;
  bool default_material = false;  // some primitive names none: geometries use materials.size()
  std::vector<std::string> warnings;

  std::uint64_t bytes() const;
};

// `nodes`: those to show, ascending; `variant`: of the materials, -1 for none. Errors (exit 6)
// where a limit would be passed; nothing has been allocated in proportion to counts in the file by
// then.
util::Result<GeometryPlan> plan_geometry(const gltf::Document& document,
                                         const std::vector<int>& nodes, int variant,
                                         const util::Limits& limits);

// By geometry: 1 where corners b and c are swapped, because the node mirrors.
using Winding = std::vector<std::uint8_t>;

// Fills the arrays of geometry and the bounds.
util::Result<void> place_geometry(const gltf::Document& document, const GeometryPlan& plan,
                                  const Pose& pose, const std::vector<glm::dmat4>& worlds,
                                  Scene& scene, Winding& winding);

// Of a plan's instances, those that `chosen` (by geometry) names; places in the arrays stay.
GeometryPlan part_of(const GeometryPlan& plan, const std::vector<bool>& chosen);

// Places a part of a plan again, in a scene in which the whole plan has been placed before. The
// outcome has the same bits as a scene placed anew. After an error the part must be placed again.
util::Result<SceneChanges> replace_geometry(const gltf::Document& document,
                                            const GeometryPlan& part, const Pose& pose,
                                            const std::vector<glm::dmat4>& worlds, Scene& scene,
                                            Winding& winding);

// The same of positions alone: those of another moment, beside a scene.
util::Result<void> replace_positions(const gltf::Document& document, const GeometryPlan& part,
                                     const Pose& pose, const std::vector<glm::dmat4>& worlds,
                                     std::vector<kernels::Vec3>& positions);

}  // namespace octrace::scene
