#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>

#include "backend/scene/deform.h"
#include "backend/scene/instances.h"

namespace octrace::scene {

namespace {

struct Totals {
  std::uint64_t triangles = 0, vertices = 0, normals = 0, tangents = 0, uvs = 0, colors = 0;
  std::uint64_t geometries = 0;

  std::uint64_t bytes() const {
    return triangles * (sizeof(kernels::Triangle) + 4) +
           (vertices + normals) * sizeof(kernels::Vec3) +
           (tangents + colors) * sizeof(kernels::Vec4) + uvs * sizeof(kernels::Vec2) +
           geometries * sizeof(kernels::Geometry);
  }
};

// Gives each instance's geometries their places behind the scene's own.
Totals place_copies(const Scene& scene, std::vector<kernels::Geometry>& copies) {
  Totals sum{scene.triangles.size(), scene.positions.size(), scene.normals.size(),
             scene.tangents.size(),  scene.uvs.size(),       scene.colors.size(),
             scene.geometries.size()};
  const Instancing& instancing = *scene.instancing;
  for (const kernels::Instance& instance : instancing.instances) {
    const MeshRange& range = instancing.ranges[instance.mesh];
    for (std::uint32_t g = 0; g < range.geometry_count; ++g) {
      kernels::Geometry copy = instancing.meshes->geometries[range.first_geometry + g];
      copy.object = instance.object;
      const auto move = [&](std::uint32_t& first, std::uint64_t& total) {
        if (first == kernels::kNone) return;
        first = static_cast<std::uint32_t>(total);
        total += copy.vertex_count;
      };
      copy.first_triangle = static_cast<std::uint32_t>(sum.triangles);
      sum.triangles += copy.triangle_count;
      move(copy.first_vertex, sum.vertices);
      move(copy.normals, sum.normals);
      move(copy.tangents, sum.tangents);
      move(copy.uv0, sum.uvs);
      move(copy.uv1, sum.uvs);
      move(copy.colors, sum.colors);
      copies.push_back(copy);
    }
  }
  sum.geometries += copies.size();
  return sum;
}

glm::dmat4 matrix_of(const kernels::Instance& instance) {
  glm::dmat4 matrix(1.0);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) matrix[c][r] = instance.to_world[r][c];
    matrix[3][r] = instance.to_mesh[r][3];
  }
  return matrix;
}

void fill_copy(const Scene& meshes, const kernels::Geometry& from, const kernels::Geometry& to,
               const kernels::Instance& instance, std::uint32_t index, Scene& scene) {
  const glm::dmat4 matrix = matrix_of(instance);
  const DirectionTransform directions(matrix);
  for (std::uint32_t v = 0; v < from.vertex_count; ++v) {
    const glm::dvec4 p(glm::dvec3(meshes.positions[from.first_vertex + v]), 1.0);
    scene.positions[to.first_vertex + v] = kernels::Vec3(matrix * p);
    if (from.normals != kernels::kNone) {
      scene.normals[to.normals + v] =
          kernels::Vec3(directions.normal(glm::dvec3(meshes.normals[from.normals + v])));
    }
    if (from.tangents != kernels::kNone) {
      scene.tangents[to.tangents + v] =
          kernels::Vec4(directions.tangent(glm::dvec4(meshes.tangents[from.tangents + v])));
    }
  }
  const auto copy = [&](const auto& source, std::uint32_t first, auto& target,
                        std::uint32_t to_first) {
    if (first == kernels::kNone) return;
    std::copy_n(source.begin() + first, from.vertex_count, target.begin() + to_first);
  };
  copy(meshes.uvs, from.uv0, scene.uvs, to.uv0);
  copy(meshes.uvs, from.uv1, scene.uvs, to.uv1);
  copy(meshes.colors, from.colors, scene.colors, to.colors);
  for (std::uint32_t t = 0; t < from.triangle_count; ++t) {
    auto [a, b, c] = meshes.triangles[from.first_triangle + t];
    if (directions.mirrors()) std::swap(b, c);
    const auto moved = [&](std::uint32_t corner) {
      return corner - from.first_vertex + to.first_vertex;
    };
    scene.triangles[to.first_triangle + t] = {moved(a), moved(b), moved(c)};
    scene.triangle_geometry[to.first_triangle + t] = index;
  }
}

}  // namespace

util::Result<Scene> bake_instances(const Scene& scene, const util::Limits& limits) {
  Scene baked = scene;
  baked.instancing.reset();
  if (!scene.instancing) return baked;
  const Instancing& instancing = *scene.instancing;
  const std::uint64_t triangles = scene.triangles.size() + instancing.triangles;
  const auto over = [&](std::uint64_t needed, const char* what, const char* option,
                        std::uint64_t allowed) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("with a copy for each of its {} instances the scene has {} {}, "
                                   "{} allows {}",
                                   instancing.instances.size(), needed, what, option, allowed),
                       "", ""};
  };
  constexpr std::uint64_t kMost = 0x7fffffffu;
  const std::uint64_t allowed = std::min(limits.max_triangles, kMost);
  if (triangles > allowed) return over(triangles, "triangles", "--max-triangles", allowed);
  std::uint64_t geometries = 0;
  for (const auto& instance : instancing.instances) {
    geometries += instancing.ranges[instance.mesh].geometry_count;
  }
  if (geometries * sizeof(kernels::Geometry) > limits.max_scene_bytes) {
    return over(geometries * sizeof(kernels::Geometry), "bytes or more", "--max-scene-bytes",
                limits.max_scene_bytes);
  }
  std::vector<kernels::Geometry> copies;
  const Totals sum = place_copies(scene, copies);
  if (sum.bytes() > limits.max_scene_bytes) {
    return over(sum.bytes(), "bytes", "--max-scene-bytes", limits.max_scene_bytes);
  }
  if (std::max({sum.vertices, sum.uvs}) >= kernels::kNone) {
    return over(sum.vertices, "vertices", "the range of indices", kernels::kNone - 1);
  }
  const auto first = static_cast<std::uint32_t>(scene.geometries.size());
  baked.geometries.insert(baked.geometries.end(), copies.begin(), copies.end());
  baked.positions.resize(sum.vertices);
  baked.triangles.resize(sum.triangles);
  baked.triangle_geometry.resize(sum.triangles);
  baked.normals.resize(sum.normals);
  baked.tangents.resize(sum.tangents);
  baked.uvs.resize(sum.uvs);
  baked.colors.resize(sum.colors);
  std::vector<std::uint32_t> first_copy(instancing.instances.size());
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < first_copy.size(); ++i) {
    first_copy[i] = next;
    next += instancing.ranges[instancing.instances[i].mesh].geometry_count;
  }
  tbb::parallel_for(std::size_t{0}, instancing.instances.size(), [&](std::size_t i) {
    const kernels::Instance& instance = instancing.instances[i];
    const MeshRange& range = instancing.ranges[instance.mesh];
    for (std::uint32_t g = 0; g < range.geometry_count; ++g) {
      const std::uint32_t copy = first_copy[i] + g;
      fill_copy(*instancing.meshes, instancing.meshes->geometries[range.first_geometry + g],
                copies[copy], instance, first + copy, baked);
    }
  });
  baked.bounds = bounds_of(baked.positions);
  return baked;
}

}  // namespace octrace::scene
