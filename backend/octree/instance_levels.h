// The two levels of octrees over a scene's instances: one octree over the instances' boxes, and one
// for each mesh, in the node format and by the builders of every other octree.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "backend/util/huge_vector.h"
#include "backend/util/result.h"
#include "kernels/instance.h"

namespace octrace::scene {
struct Scene;
struct Instancing;
}  // namespace octrace::scene

namespace octrace::octree {

struct BuildOptions;
struct Octree;

struct InstanceLevels {
  util::HugeVector<kernels::Node> top_nodes;
  util::HugeVector<kernels::LeafTriangle> boxes;  // of the top octree, as InstancedSceneView has
  util::HugeVector<kernels::Node> nodes;          // of all meshes' octrees
  util::HugeVector<kernels::LeafTriangle> triangles;
  std::vector<kernels::MeshRoot> roots;            // by mesh
  std::shared_ptr<const scene::Scene> meshes;      // that the octrees were built for
  std::shared_ptr<const scene::Instancing> shown;  // and the instances

  bool empty() const { return roots.empty(); }
  std::uint64_t bytes() const;
};

// Nothing where the scene has no instances. Errors as build() of octree.h.
util::Result<InstanceLevels> build_instance_levels(const scene::Scene& scene,
                                                   const BuildOptions& options);
// For a scene whose instances have moved: the top octree is built anew, the meshes' octrees only
// where the meshes are others.
util::Result<void> update_instance_levels(const scene::Scene& scene, const BuildOptions& options,
                                          InstanceLevels& levels);

// kCullBack and so on, by geometry.
std::vector<std::uint32_t> geometry_flags(std::span<const kernels::Geometry> geometries,
                                          std::span<const kernels::Material> materials);

util::Result<void> verify_instance_levels(const InstanceLevels& levels, const scene::Scene& scene);

// The scene and its octrees as the kernels take them; valid while both are unchanged.
kernels::InstancedSceneView instanced_view(const scene::Scene& scene, const Octree& octree);

}  // namespace octrace::octree
