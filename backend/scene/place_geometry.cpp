#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <span>

#include "backend/scene/deform.h"
#include "backend/scene/flatten_geometry.h"
#include "backend/scene/names.h"
#include "backend/scene/triangulate.h"

namespace octrace::scene {

namespace {

using tbb::blocked_range;

constexpr std::size_t kGrain = 4096;  // vertices a task

// What is read once of a primitive, for all nodes that show it.
struct SourceData {
  Vertices vertices;
  std::vector<kernels::Triangle> triangles;  // of a first placing only
  SkinBinding binding;
};

// Where placed vertices go. What is not asked for is empty.
struct Arrays {
  std::span<kernels::Vec3> positions, normals;
  std::span<kernels::Vec4> tangents;
  std::span<kernels::Vec2> uvs;
  std::span<kernels::Vec4> colors;
  std::span<kernels::Triangle> triangles;
  std::span<std::uint32_t> triangle_geometry;  // of a first placing only
  std::span<std::uint8_t> winding;
};

Arrays arrays_of(Scene& scene, Winding& winding) {
  return {
      scene.positions, scene.normals, scene.tangents, scene.uvs, scene.colors, scene.triangles, {},
      winding};
}

bool morphs_plain_attributes(const tinygltf::Primitive& primitive) {
  return std::any_of(primitive.targets.begin(), primitive.targets.end(), [](const auto& target) {
    return target.contains("TEXCOORD_0") || target.contains("TEXCOORD_1") ||
           target.contains("COLOR_0");
  });
}

class Placer {
 public:
  Placer(const gltf::Document& document, const GeometryPlan& plan, const Pose& pose,
         const std::vector<glm::dmat4>& worlds, const Arrays& to)
      : document_(document), plan_(plan), pose_(pose), worlds_(worlds), to_(to) {}

  util::Result<void> place() {
    // One slot a source, so that the error that is reported does not depend on timing.
    std::vector<std::optional<util::Error>> errors(plan_.sources.size());
    tbb::parallel_for(std::size_t{0}, plan_.sources.size(), [&](std::size_t i) {
      if (auto ok = place_source(plan_.sources[i]); !ok) errors[i] = ok.error();
    });
    for (const auto& error : errors) {
      if (error) return *error;
    }
    return {};
  }

  bool wound_otherwise() const { return wound_otherwise_; }  // some geometry, than before

 private:
  bool first() const { return !to_.triangle_geometry.empty(); }

  util::Error error(util::Exit exit, std::string code, std::string pointer,
                    std::string message) const {
    return {exit, std::move(code), std::move(message), document_.file, std::move(pointer)};
  }

  std::string primitive_pointer(const GeometryPlan::Source& source) const {
    return fmt::format("/meshes/{}/primitives/{}", source.mesh, source.primitive);
  }

  util::Result<void> place_source(const GeometryPlan::Source& source) {
    const tinygltf::Primitive& primitive =
        document_.model.meshes[source.mesh].primitives[source.primitive];
    auto data = read(source, primitive);
    if (!data) return data.error();
    for (const auto& instance : source.instances) {
      if (!morph_active(primitive, instance.node)) {
        if (auto ok = place_instance(source, instance, *data, data->vertices); !ok) return ok;
        continue;
      }
      Vertices morphed = data->vertices;
      add_morph_targets(document_, primitive, pose_.weights[instance.node], morphed);
      if (auto ok = place_instance(source, instance, *data, morphed); !ok) return ok;
    }
    return {};
  }

  bool morph_active(const tinygltf::Primitive& primitive, int node) const {
    const auto& weights = pose_.weights[node];
    return !primitive.targets.empty() &&
           std::any_of(weights.begin(), weights.end(), [](double w) { return w != 0.0; });
  }

  util::Result<SourceData> read(const GeometryPlan::Source& source,
                                const tinygltf::Primitive& primitive) const {
    SourceData data;
    const VertexParts parts{
        !to_.normals.empty() || !to_.tangents.empty(),
        first() || (!to_.winding.empty() && morphs_plain_attributes(primitive))};
    data.vertices = read_vertices(document_, primitive, parts);
    const kernels::Geometry& geometry = plan_.geometries[source.instances.front().geometry];
    if (data.vertices.positions.size() != geometry.vertex_count) {
      return error(util::Exit::internal, "", primitive_pointer(source),
                   fmt::format("has {} vertices, {} were planned", data.vertices.positions.size(),
                               geometry.vertex_count));
    }
    if (first()) {
      if (auto ok = read_triangles(source, primitive, geometry, data); !ok) return ok.error();
    }
    const bool skinned = std::any_of(
        source.instances.begin(), source.instances.end(),
        [&](const auto& instance) { return document_.model.nodes[instance.node].skin >= 0; });
    if (skinned) data.binding = read_skin_binding(document_, primitive);
    return data;
  }

  util::Result<void> read_triangles(const GeometryPlan::Source& source,
                                    const tinygltf::Primitive& primitive,
                                    const kernels::Geometry& geometry, SourceData& data) const {
    std::vector<std::uint32_t> indices;
    if (primitive.indices >= 0) indices = document_.read_uints(primitive.indices);
    data.triangles = triangulate(primitive.mode, indices, geometry.vertex_count);
    if (data.triangles.size() != geometry.triangle_count) {
      return error(util::Exit::internal, "", primitive_pointer(source),
                   fmt::format("has {} triangles, {} were planned", data.triangles.size(),
                               geometry.triangle_count));
    }
    const auto outside = std::find_if(indices.begin(), indices.end(), [&](std::uint32_t index) {
      return index >= geometry.vertex_count;
    });
    if (outside == indices.end()) return {};
    return error(util::Exit::invalid_input, "ACCESSOR_INDEX_OOB",
                 primitive_pointer(source) + "/indices",
                 fmt::format("index {} is {}, there are {} vertices", outside - indices.begin(),
                             *outside, geometry.vertex_count));
  }

  util::Result<void> check_binding(const GeometryPlan::Source& source, const SkinBinding& binding,
                                   std::size_t vertices, std::size_t joints) const {
    for (std::size_t set = 0; set < binding.joints.size(); ++set) {
      const auto& used = binding.joints[set];
      const std::string pointer =
          fmt::format("{}/attributes/JOINTS_{}", primitive_pointer(source), set);
      if (used.size() != 4 * vertices || binding.weights[set].size() != 4 * vertices) {
        return error(util::Exit::invalid_input, "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT", pointer,
                     fmt::format("needs {} joints and weights, has {} and {}", 4 * vertices,
                                 used.size(), binding.weights[set].size()));
      }
      const auto worst = std::max_element(used.begin(), used.end());
      if (worst == used.end() || *worst < joints) continue;
      return error(util::Exit::invalid_input, "ACCESSOR_JOINTS_INDEX_OOB", pointer,
                   fmt::format("joint {} is named, the skin has {}", *worst, joints));
    }
    return {};
  }

  util::Result<void> place_instance(const GeometryPlan::Source& source,
                                    const GeometryPlan::Instance& instance, const SourceData& data,
                                    const Vertices& vertices) {
    const kernels::Geometry& geometry = plan_.geometries[instance.geometry];
    const tinygltf::Node& node = document_.model.nodes[instance.node];
    std::atomic<bool> in_range{true};
    std::atomic<std::size_t> mirrored{0};
    const blocked_range<std::size_t> all(0, geometry.vertex_count, kGrain);
    // Which way a skinned triangle faces is for its joints to say, since its node's own transform
    // is to be ignored: the mesh is taken as mirrored where more than half of its vertices are.
    bool mirrors = false;
    if (node.skin >= 0 && !data.binding.empty()) {
      const auto joints = joint_matrices(document_, node.skin, worlds_);
      if (auto ok = check_binding(source, data.binding, geometry.vertex_count, joints.size()); !ok)
        return ok;
      tbb::parallel_for(all, [&](const blocked_range<std::size_t>& range) {
        std::size_t count = 0;
        for (std::size_t v = range.begin(); v != range.end(); ++v) {
          const glm::dmat4 matrix = blend_joints(data.binding, joints, v);
          const DirectionTransform directions(matrix);
          if (!place_vertex(geometry, vertices, v, matrix, directions)) in_range = false;
          count += directions.mirrors();
        }
        mirrored += count;
      });
      mirrors = 2 * mirrored > geometry.vertex_count;
    } else {
      const glm::dmat4& matrix = worlds_[instance.node];
      const DirectionTransform directions(matrix);
      mirrors = directions.mirrors();
      tbb::parallel_for(all, [&](const blocked_range<std::size_t>& range) {
        for (std::size_t v = range.begin(); v != range.end(); ++v) {
          if (!place_vertex(geometry, vertices, v, matrix, directions)) in_range = false;
        }
      });
    }
    if (!in_range) {
      return error(util::Exit::unsupported, "", fmt::format("/nodes/{}", instance.node),
                   fmt::format("places a vertex of mesh \"{}\" beyond {:g} m or nowhere; positions "
                               "must be finite and within that",
                               printable(name_of(document_.model.meshes, source.mesh, "mesh")),
                               kMaxCoordinate));
    }
    place_plain_attributes(geometry, vertices);
    if (first()) {
      place_triangles(geometry, instance.geometry, data.triangles, mirrors);
    } else if (!to_.winding.empty() && to_.winding[instance.geometry] != mirrors) {
      for (std::size_t t = 0; t < geometry.triangle_count; ++t) {
        kernels::Triangle& triangle = to_.triangles[geometry.first_triangle + t];
        std::swap(triangle.b, triangle.c);
      }
      to_.winding[instance.geometry] = mirrors;
      wound_otherwise_ = true;
    }
    return {};
  }

  bool place_vertex(const kernels::Geometry& geometry, const Vertices& vertices, std::size_t v,
                    const glm::dmat4& matrix, const DirectionTransform& directions) {
    const glm::dvec3 p(matrix * glm::dvec4(vertices.positions[v], 1.0));
    const auto fits = [](double x) { return std::abs(x) <= double{kMaxCoordinate}; };
    if (!fits(p.x) || !fits(p.y) || !fits(p.z)) return false;
    to_.positions[geometry.first_vertex + v] = kernels::Vec3(p);
    if (!vertices.normals.empty()) {
      to_.normals[geometry.normals + v] = kernels::Vec3(directions.normal(vertices.normals[v]));
    }
    if (!vertices.tangents.empty()) {
      to_.tangents[geometry.tangents + v] = kernels::Vec4(directions.tangent(vertices.tangents[v]));
    }
    return true;
  }

  // Those that no matrix changes.
  void place_plain_attributes(const kernels::Geometry& geometry, const Vertices& vertices) {
    const auto copy = [](const auto& from, auto& to, std::uint32_t first) {
      if (first == kernels::kNone) return;
      for (std::size_t v = 0; v < from.size(); ++v) {
        to[first + v] = typename std::decay_t<decltype(to)>::value_type(from[v]);
      }
    };
    copy(vertices.uvs[0], to_.uvs, geometry.uv0);
    copy(vertices.uvs[1], to_.uvs, geometry.uv1);
    copy(vertices.colors, to_.colors, geometry.colors);
  }

  void place_triangles(const kernels::Geometry& geometry, std::uint32_t index,
                       const std::vector<kernels::Triangle>& triangles, bool mirrors) {
    const std::uint32_t base = geometry.first_vertex;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      auto [a, b, c] = triangles[t];
      if (mirrors) std::swap(b, c);
      to_.triangles[geometry.first_triangle + t] = {base + a, base + b, base + c};
      to_.triangle_geometry[geometry.first_triangle + t] = index;
    }
    to_.winding[index] = mirrors;
  }

  const gltf::Document& document_;
  const GeometryPlan& plan_;
  const Pose& pose_;
  const std::vector<glm::dmat4>& worlds_;
  const Arrays to_;
  std::atomic<bool> wound_otherwise_{false};
};

}  // namespace

util::Result<void> place_geometry(const gltf::Document& document, const GeometryPlan& plan,
                                  const Pose& pose, const std::vector<glm::dmat4>& worlds,
                                  Scene& scene, Winding& winding) {
  scene.geometries = plan.geometries;
  scene.positions.resize(plan.vertices);
  scene.triangles.resize(plan.triangles);
  scene.triangle_geometry.resize(plan.triangles);
  scene.normals.resize(plan.normals);
  scene.tangents.resize(plan.tangents);
  scene.uvs.resize(plan.uvs);
  scene.colors.resize(plan.colors);
  winding.assign(plan.geometries.size(), 0);
  Arrays to = arrays_of(scene, winding);
  to.triangle_geometry = scene.triangle_geometry;
  if (auto ok = Placer(document, plan, pose, worlds, to).place(); !ok) return ok;
  scene.bounds = bounds_of(scene.positions);
  return {};
}

GeometryPlan part_of(const GeometryPlan& plan, const std::vector<bool>& chosen) {
  GeometryPlan part;
  part.geometries = plan.geometries;
  for (const GeometryPlan::Source& source : plan.sources) {
    GeometryPlan::Source some{source.mesh, source.primitive, {}};
    for (const GeometryPlan::Instance& instance : source.instances) {
      if (chosen[instance.geometry]) some.instances.push_back(instance);
    }
    if (!some.instances.empty()) part.sources.push_back(std::move(some));
  }
  return part;
}

util::Result<SceneChanges> replace_geometry(const gltf::Document& document,
                                            const GeometryPlan& part, const Pose& pose,
                                            const std::vector<glm::dmat4>& worlds, Scene& scene,
                                            Winding& winding) {
  SceneChanges changes;
  if (part.sources.empty()) return changes;
  Placer placer(document, part, pose, worlds, arrays_of(scene, winding));
  if (auto ok = placer.place(); !ok) return ok.error();
  scene.bounds = bounds_of(scene.positions);
  changes.positions = true;
  changes.triangles = placer.wound_otherwise();
  for (const GeometryPlan::Source& source : part.sources) {
    const kernels::Geometry& geometry = part.geometries[source.instances.front().geometry];
    changes.normals |= geometry.normals != kernels::kNone;
    changes.tangents |= geometry.tangents != kernels::kNone;
    if (!morphs_plain_attributes(document.model.meshes[source.mesh].primitives[source.primitive])) {
      continue;
    }
    changes.uvs |= geometry.uv0 != kernels::kNone || geometry.uv1 != kernels::kNone;
    changes.colors |= geometry.colors != kernels::kNone;
  }
  return changes;
}

util::Result<void> replace_positions(const gltf::Document& document, const GeometryPlan& part,
                                     const Pose& pose, const std::vector<glm::dmat4>& worlds,
                                     std::vector<kernels::Vec3>& positions) {
  Arrays to;
  to.positions = positions;
  return Placer(document, part, pose, worlds, to).place();
}

}  // namespace octrace::scene
