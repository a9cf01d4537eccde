#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "exporters/gltf/parts.h"

namespace octrace::exporters {

namespace {

using Json = nlohmann::ordered_json;
using kernels::Geometry;
using kernels::kNone;

template <class T>
std::span<const float> floats_of(const std::vector<T>& values) {
  return {reinterpret_cast<const float*>(values.data()), values.size() * sizeof(T) / sizeof(float)};
}

template <class T>
std::vector<T> attribute(const std::vector<T>& all, std::uint32_t first, const Geometry& geometry) {
  const auto begin = all.begin() + first;
  return {begin, begin + geometry.vertex_count};
}

// glTF demands unit vectors; a direction that is none becomes +Z, which changes nothing that can be
// seen: renderers fall back to the flat normal or shade it arbitrarily.
kernels::Vec3 unit_or_z(const kernels::Vec3& v) {
  const glm::dvec3 d(v);
  const double length = glm::length(d);
  if (!(length > 0.0) || !std::isfinite(length)) return {0, 0, 1};
  return kernels::Vec3(d / length);
}

bool is_unit(const kernels::Vec3& v) { return std::abs(glm::length(glm::dvec3(v)) - 1.0) < 1e-6; }

int append_normals(GltfJob& job, const Geometry& geometry) {
  auto normals = attribute(job.scene.normals, geometry.normals, geometry);
  for (auto& normal : normals) {
    if (!is_unit(normal)) normal = unit_or_z(normal);
  }
  return job.glb.add_floats(floats_of(normals), 3, false);
}

int append_tangents(GltfJob& job, const Geometry& geometry) {
  auto tangents = attribute(job.scene.tangents, geometry.tangents, geometry);
  for (auto& tangent : tangents) {
    const kernels::Vec3 axis(tangent);
    tangent = kernels::Vec4(is_unit(axis) ? axis : unit_or_z(axis), tangent.w < 0.0f ? -1 : 1);
  }
  return job.glb.add_floats(floats_of(tangents), 4, false);
}

// The sets are numbered without gaps, and a texture must find its set: a missing one is zeros,
// which is what octrace reads there.
void append_uvs(GltfJob& job, const Geometry& geometry, Json& attributes) {
  int sets = geometry.uv1 != kNone ? 2 : geometry.uv0 != kNone ? 1 : 0;
  sets = std::max(sets, texcoord_sets(job.scene.materials[geometry.material]));
  for (int set = 0; set < sets; ++set) {
    const std::uint32_t first = set == 0 ? geometry.uv0 : geometry.uv1;
    std::vector<kernels::Vec2> uvs(geometry.vertex_count, kernels::Vec2(0.0f));
    if (first != kNone) uvs = attribute(job.scene.uvs, first, geometry);
    for (auto& uv : uvs) {
      if (!std::isfinite(uv.x)) uv.x = 0.0f;
      if (!std::isfinite(uv.y)) uv.y = 0.0f;
    }
    attributes[set == 0 ? "TEXCOORD_0" : "TEXCOORD_1"] =
        job.glb.add_floats(floats_of(uvs), 2, false);
  }
}

int append_colors(GltfJob& job, const Geometry& geometry) {
  auto colors = attribute(job.scene.colors, geometry.colors, geometry);
  for (auto& color : colors) {
    for (int c = 0; c < 4; ++c) {
      const float clamped = color[c] > 0.0f ? std::min(color[c], 1.0f) : 0.0f;
      if (clamped != color[c]) job.note("vertex colours outside of [0, 1] were clamped");
      color[c] = clamped;
    }
  }
  return job.glb.add_floats(floats_of(colors), 4, false);
}

Json primitive_record(GltfJob& job, const Geometry& geometry) {
  const scene::Scene& scene = job.scene;
  Json attributes;
  attributes["POSITION"] = job.glb.add_floats(
      floats_of(attribute(scene.positions, geometry.first_vertex, geometry)), 3, true);
  if (geometry.normals != kNone) attributes["NORMAL"] = append_normals(job, geometry);
  // Without normals tangents mean nothing.
  if (geometry.tangents != kNone && geometry.normals != kNone) {
    attributes["TANGENT"] = append_tangents(job, geometry);
  }
  append_uvs(job, geometry, attributes);
  if (geometry.colors != kNone) attributes["COLOR_0"] = append_colors(job, geometry);

  std::vector<std::uint32_t> indices;
  indices.reserve(std::size_t{geometry.triangle_count} * 3);
  for (std::uint32_t i = 0; i < geometry.triangle_count; ++i) {
    const kernels::Triangle& t = scene.triangles[std::size_t{geometry.first_triangle} + i];
    indices.insert(indices.end(), {t.a - geometry.first_vertex, t.b - geometry.first_vertex,
                                   t.c - geometry.first_vertex});
  }
  return {{"attributes", std::move(attributes)},
          {"indices", job.glb.add_indices(indices, geometry.vertex_count)},
          {"material", geometry.material},
          {"mode", 4}};
}

}  // namespace

int append_mesh(GltfJob& job, std::uint32_t object, const std::vector<std::uint32_t>& geometries) {
  Json mesh;
  if (object < job.scene.object_names.size() && !job.scene.object_names[object].empty()) {
    mesh["name"] = job.scene.object_names[object];
  }
  for (const std::uint32_t index : geometries) {
    mesh["primitives"].push_back(primitive_record(job, job.scene.geometries[index]));
  }
  return job.glb.add("meshes", std::move(mesh));
}

}  // namespace octrace::exporters
