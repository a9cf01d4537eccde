#include "backend/octree/instance_levels.h"

#include <fmt/format.h>

#include "backend/octree/octree.h"
#include "backend/scene/instances.h"

namespace octrace::octree {

namespace {

using kernels::Triangle;

// The builders split triangles by their boxes, so a box goes to them as the triangle of its two
// corners.
struct BoxTriangles {
  std::vector<kernels::Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> meshes, flags;

  // kBlend, by mesh: builders never cut such a triangle into parts, and a box is not to be.
  explicit BoxTriangles(const scene::Instancing& instancing)
      : flags(instancing.ranges.size(), kernels::kBlend) {
    const std::size_t count = instancing.instances.size();
    positions.reserve(2 * count);
    triangles.reserve(count);
    meshes.reserve(count);
    for (const kernels::Instance& instance : instancing.instances) {
      const auto box = scene::instance_box(instance, instancing.ranges[instance.mesh].half_extent);
      const auto first = static_cast<std::uint32_t>(positions.size());
      positions.push_back(box.lower);
      positions.push_back(box.upper);
      triangles.push_back({first, first + 1, first + 1});
      meshes.push_back(instance.mesh);
    }
  }
  BuildInput input() const { return {positions, triangles, meshes, flags}; }
};

// One mesh's triangles with indices of its own.
struct MeshTriangles {
  const scene::Scene& scene;
  const scene::MeshRange& range;
  std::vector<Triangle> triangles;

  MeshTriangles(const scene::Instancing& instancing, const scene::MeshRange& mesh)
      : scene(*instancing.meshes), range(mesh) {
    triangles.reserve(range.triangle_count);
    for (std::uint32_t t = 0; t < range.triangle_count; ++t) {
      const auto& [a, b, c] = scene.triangles[range.first_triangle + t];
      triangles.push_back({a - range.first_vertex, b - range.first_vertex, c - range.first_vertex});
    }
  }
  BuildInput input(std::span<const std::uint32_t> flags) const {
    return {std::span(scene.positions).subspan(range.first_vertex, range.vertex_count), triangles,
            std::span(scene.triangle_geometry).subspan(range.first_triangle, range.triangle_count),
            flags};
  }
};

std::vector<std::uint32_t> flags_of_meshes(const scene::Scene& scene) {
  return geometry_flags(scene.instancing->meshes->geometries, scene.materials);
}

util::Error located(util::Error error, const char* what) {
  error.message = fmt::format("{}: {}", what, error.message);
  return error;
}

}  // namespace

std::uint64_t InstanceLevels::bytes() const {
  return (top_nodes.size() + nodes.size()) * sizeof(kernels::Node) +
         (boxes.size() + triangles.size()) * sizeof(kernels::LeafTriangle) +
         roots.size() * sizeof(kernels::MeshRoot);
}

util::Result<void> update_instance_levels(const scene::Scene& scene, const BuildOptions& options,
                                          InstanceLevels& levels) {
  if (!scene.instancing || scene.instancing == levels.shown) return {};
  if (scene.instancing->meshes != levels.meshes) {
    util::Result<InstanceLevels> built = build_instance_levels(scene, options);
    if (!built) return built.error();
    levels = std::move(*built);
    return {};
  }
  const BoxTriangles boxes(*scene.instancing);
  util::Result<Octree> top = build(boxes.input(), options);
  if (!top) return located(top.error(), "instances");
  levels.top_nodes = std::move(top->nodes);
  levels.boxes = std::move(top->triangles);
  levels.shown = scene.instancing;
  return {};
}

util::Result<InstanceLevels> build_instance_levels(const scene::Scene& scene,
                                                   const BuildOptions& options) {
  InstanceLevels levels;
  if (!scene.instancing) return levels;
  const std::vector<std::uint32_t> flags = flags_of_meshes(scene);
  for (const scene::MeshRange& range : scene.instancing->ranges) {
    const MeshTriangles mesh(*scene.instancing, range);
    util::Result<Octree> octree = build(mesh.input(flags), options);
    if (!octree) return octree.error();
    const kernels::MeshRoot root{static_cast<std::uint32_t>(levels.nodes.size()),
                                 static_cast<std::uint32_t>(octree->nodes.size()),
                                 static_cast<std::uint32_t>(levels.triangles.size()),
                                 static_cast<std::uint32_t>(octree->triangles.size())};
    levels.nodes.insert(levels.nodes.end(), octree->nodes.begin(), octree->nodes.end());
    for (kernels::LeafTriangle leaf : octree->triangles) {
      leaf.triangle += range.first_triangle;
      levels.triangles.push_back(leaf);
    }
    levels.roots.push_back(root);
  }
  levels.meshes = scene.instancing->meshes;
  if (auto ok = update_instance_levels(scene, options, levels); !ok) return ok.error();
  return levels;
}

util::Result<void> verify_instance_levels(const InstanceLevels& levels, const scene::Scene& scene) {
  if (!scene.instancing) return {};
  const BoxTriangles boxes(*scene.instancing);
  Octree octree;
  octree.nodes = levels.top_nodes;
  octree.triangles = levels.boxes;
  if (auto ok = verify(octree, boxes.input()); !ok) return located(ok.error(), "instances");
  const std::vector<std::uint32_t> flags = flags_of_meshes(scene);
  for (std::size_t m = 0; m < levels.roots.size(); ++m) {
    const kernels::MeshRoot& root = levels.roots[m];
    const scene::MeshRange& range = scene.instancing->ranges[m];
    const auto first_node = levels.nodes.begin() + root.first_node;
    const auto first_triangle = levels.triangles.begin() + root.first_triangle;
    octree.nodes.assign(first_node, first_node + root.node_count);
    octree.triangles.assign(first_triangle, first_triangle + root.triangle_count);
    for (kernels::LeafTriangle& leaf : octree.triangles) leaf.triangle -= range.first_triangle;
    const MeshTriangles mesh(*scene.instancing, range);
    if (auto ok = verify(octree, mesh.input(flags)); !ok) {
      return located(ok.error(), fmt::format("instanced mesh {}", m).c_str());
    }
  }
  return {};
}

kernels::InstancedSceneView instanced_view(const scene::Scene& scene, const Octree& octree) {
  kernels::InstancedSceneView view{scene.view(), {}, {}, {}, {}};
  view.octree = octree.view();
  if (!scene.instancing) return view;
  const InstanceLevels& levels = octree.instances;
  view.meshes = scene.instancing->meshes->view();
  view.meshes.materials = view.materials;
  view.meshes.textures = view.textures;
  view.meshes.texels = view.texels;
  view.meshes.lights = view.lights;
  view.meshes.octree = {{levels.nodes.data(), levels.nodes.size()},
                        {levels.triangles.data(), levels.triangles.size()}};
  view.top = {{levels.top_nodes.data(), levels.top_nodes.size()},
              {levels.boxes.data(), levels.boxes.size()}};
  view.roots = {levels.roots.data(), levels.roots.size()};
  view.instances = {scene.instancing->instances.data(), scene.instancing->instances.size()};
  return view;
}

}  // namespace octrace::octree
