// Meshes that nodes show many times (EXT_mesh_gpu_instancing): the mesh is kept once, and each
// instance is a record of 96 bytes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/scene/flatten_geometry.h"
#include "backend/scene/pose.h"
#include "backend/scene/scene.h"
#include "kernels/instance.h"

namespace octrace::scene {

// How a mesh's space lies in the mesh as the file has it.
struct MeshSpace {
  glm::dvec3 centre{0.0};
  double scale = 1.0;  // a power of two: metres of the mesh a unit of its space
};

// One mesh in `meshes`: runs of its arrays. half_extent: of its bounds, which are centred on 0.
struct MeshRange {
  std::uint32_t first_geometry, geometry_count;
  std::uint32_t first_triangle, triangle_count;
  std::uint32_t first_vertex, vertex_count;
  kernels::Vec3 half_extent;
  MeshSpace space;
};

// Invariants: every index is in range, every instance's box is within +-kMaxCoordinate and every
// instance's mesh has triangles.
struct Instancing {
  std::shared_ptr<const Scene> meshes;  // geometry alone, in the meshes' own spaces
  std::vector<MeshRange> ranges;        // by Instance::mesh
  std::vector<kernels::Instance> instances;
  std::uint64_t triangles = 0;  // of all instances

  std::uint64_t bytes() const;
};

// A box around the instance that holds every hit: see kernels/instance.h and place_instances.cpp.
Bounds instance_box(const kernels::Instance& instance, const kernels::Vec3& half_extent);

// Everything that does not depend on the pose.
struct InstancePlan {
  struct NodeInstances {
    int node;
    std::uint32_t mesh;  // index into mesh_nodes
    std::uint32_t first_object;
    std::uint64_t count;
  };
  std::vector<NodeInstances> nodes;
  std::vector<int> mesh_nodes;   // one node for each mesh that is kept, ascending
  std::vector<int> plain_nodes;  // the other nodes of the scene, to be flattened as ever
  GeometryPlan meshes;
  std::uint64_t instances = 0;

  bool empty() const { return nodes.empty(); }
  std::uint64_t bytes() const;  // of what is made of it, an upper estimate
};

// Errors (exit 6) where --max-instances, another limit or the range of object ids would be passed.
util::Result<InstancePlan> plan_instances(const gltf::Document& document,
                                          const std::vector<int>& nodes, int variant,
                                          const util::Limits& limits);
// World and meshes together stay within the limits that plan_geometry() compared each with.
util::Result<void> check_sum(const gltf::Document& document, const GeometryPlan& world,
                             const InstancePlan& instances, const util::Limits& limits);

// Puts the instances where a pose has them: scene.instancing, and what they add to the bounds.
// same_meshes: those that the scene holds from an earlier call are kept, because the pose does not
// change them. Adds a warning where instances are left out because they are too flat to be seen.
util::Result<void> place_instances(const gltf::Document& document, const InstancePlan& plan,
                                   const Pose& pose, const std::vector<glm::dmat4>& worlds,
                                   bool same_meshes, Scene& scene);

// What the instances add to the bounds of the rest.
void add_instance_bounds(Scene& scene);

// Of all instances; `node[3]` is the fourth instance of a node.
void append_instance_names(const gltf::Document& document, const InstancePlan& plan, Scene& scene);

// The same scene with a copy of the mesh's triangles for each instance, for those who know no
// instances. Errors: exit 6 where limits do not allow that many.
util::Result<Scene> bake_instances(const Scene& scene, const util::Limits& limits);

}  // namespace octrace::scene
