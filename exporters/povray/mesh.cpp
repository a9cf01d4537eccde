#include <fmt/format.h>

#include <glm/geometric.hpp>
#include <iterator>

#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

// POV-Ray's parser knows no NaN or infinity.
double finite(double v) { return std::isfinite(v) ? v : 0.0; }

void append_vector(std::string& out, const glm::dvec3& v) {
  fmt::format_to(std::back_inserter(out), "<{:.9g},{:.9g},{:.9g}>", finite(v.x), finite(v.y),
                 finite(v.z));
}

// Lists are wrapped every few entries: editors and diff tools choke on one line of megabytes.
void append_separator(std::string& out, std::size_t i) { out += i % 4 == 3 ? ",\n" : ","; }

}  // namespace

Fit fit_bounds(const scene::Bounds& bounds) {
  Fit fit;
  if (bounds.empty) return fit;
  const glm::dvec3 lower(bounds.lower), upper(bounds.upper);
  // A centre that float holds keeps most differences exact.
  fit.centre = glm::dvec3(glm::vec3(0.5 * (lower + upper)));
  const double radius = 0.5 * glm::length(upper - lower);
  if (radius > 0.0) fit.scale = std::exp2(std::floor(std::log2(kRadius / radius)));
  return fit;
}

void Job::note(const std::string& line) {
  for (const std::string& known : result.notes) {
    if (known == line) return;
  }
  result.notes.push_back(line);
}

bool faces_away(const Job& job, const kernels::Triangle& triangle) {
  const auto& positions = job.scene.positions;
  const glm::dvec3 a = job.fit(glm::dvec3(positions[triangle.a]));
  const glm::dvec3 b = job.fit(glm::dvec3(positions[triangle.b]));
  const glm::dvec3 c = job.fit(glm::dvec3(positions[triangle.c]));
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const glm::dvec3 to_eye = job.frame.orthographic ? job.frame.back : job.frame.eye - a;
  return glm::dot(normal, to_eye) < 0.0;
}

std::vector<std::uint32_t> kept_triangles(const Job& job, const kernels::Geometry& geometry,
                                          const MeshStyle& style) {
  std::vector<std::uint32_t> kept;
  kept.reserve(geometry.triangle_count);
  for (std::uint32_t i = 0; i < geometry.triangle_count; ++i) {
    const std::uint32_t triangle = geometry.first_triangle + i;
    if (style.drop_back_faces && faces_away(job, job.scene.triangles[triangle])) continue;
    kept.push_back(triangle);
  }
  return kept;
}

glm::dvec2 vertex_uv(const scene::Scene& scene, const kernels::Geometry& geometry,
                     const kernels::TextureRef& ref, std::uint32_t vertex) {
  const std::uint32_t first = ref.texcoord == 0 ? geometry.uv0 : geometry.uv1;
  glm::dvec3 uv(0.0, 0.0, 1.0);
  if (first != kernels::kNone) {
    const kernels::Vec2& entry = scene.uvs[std::size_t{first} + (vertex - geometry.first_vertex)];
    uv = {finite(entry.x), finite(entry.y), 1.0};
  }
  return {glm::dot(glm::dvec3(ref.transform_u), uv), glm::dot(glm::dvec3(ref.transform_v), uv)};
}

std::string mesh_name(const Job& job, std::uint32_t index) {
  const kernels::Geometry& geometry = job.scene.geometries[index];
  const std::string name = geometry.object < job.scene.object_names.size()
                               ? identifier(job.scene.object_names[geometry.object])
                               : std::string();
  return fmt::format("Mesh_{}_{}", index, name);
}

void append_mesh(std::string& out, const Job& job, std::uint32_t index, const MeshStyle& style,
                 const std::vector<std::uint32_t>& triangles, const std::string& texture) {
  const scene::Scene& scene = job.scene;
  const kernels::Geometry& geometry = scene.geometries[index];
  const std::string object = geometry.object < scene.object_names.size()
                                 ? comment_text(scene.object_names[geometry.object])
                                 : std::string();
  const std::string material = geometry.material < scene.material_names.size()
                                   ? comment_text(scene.material_names[geometry.material])
                                   : std::string();
  auto to = std::back_inserter(out);
  fmt::format_to(to, "\n// node {} \"{}\", material {} \"{}\"\n", geometry.object, object,
                 geometry.material, material);
  if (triangles.empty()) {
    fmt::format_to(to, "// nothing of it can be seen from here\n");
    return;
  }

  const std::string name = mesh_name(job, index);
  fmt::format_to(to, "#declare {} = mesh2 {{\nvertex_vectors {{ {},\n", name,
                 geometry.vertex_count);
  const std::uint32_t end = geometry.first_vertex + geometry.vertex_count;
  for (std::uint32_t v = geometry.first_vertex; v < end; ++v) {
    append_vector(out, job.fit.corner(scene.positions[v]));
    append_separator(out, v);
  }
  out += "}\n";

  if (style.normals && geometry.normals != kernels::kNone) {
    fmt::format_to(to, "normal_vectors {{ {},\n", geometry.vertex_count);
    for (std::uint32_t i = 0; i < geometry.vertex_count; ++i) {
      // POV-Ray refuses no zero vector, but shades it black.
      glm::dvec3 normal(scene.normals[std::size_t{geometry.normals} + i]);
      if (!(glm::dot(normal, normal) > 0.0)) normal = {0, 1, 0};
      append_vector(out, normal);
      append_separator(out, i);
    }
    out += "}\n";
  }

  if (style.uv != nullptr) {
    fmt::format_to(to, "uv_vectors {{ {},\n", geometry.vertex_count);
    for (std::uint32_t v = geometry.first_vertex; v < end; ++v) {
      const glm::dvec2 uv = vertex_uv(scene, geometry, *style.uv, v);
      fmt::format_to(to, "<{:.9g},{:.9g}>", finite(uv.x), finite(uv.y));
      append_separator(out, v);
    }
    out += "}\n";
  }

  if (!style.textures.empty()) {
    fmt::format_to(to, "texture_list {{ {},\n", style.textures.size());
    for (const std::string& entry : style.textures) fmt::format_to(to, "{}\n", entry);
    out += "}\n";
  }

  fmt::format_to(to, "face_indices {{ {},\n", triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const kernels::Triangle& t = scene.triangles[triangles[i]];
    const std::uint32_t a = t.a - geometry.first_vertex, b = t.b - geometry.first_vertex,
                        c = t.c - geometry.first_vertex;
    fmt::format_to(to, "<{},{},{}>", a, style.reversed ? c : b, style.reversed ? b : c);
    if (!style.vertex_textures.empty()) {
      const auto& texture_of = style.vertex_textures;
      fmt::format_to(to, ",{},{},{}", texture_of[a], texture_of[style.reversed ? c : b],
                     texture_of[style.reversed ? b : c]);
    } else if (!style.textures.empty()) {
      fmt::format_to(to, ",{}", i);
    }
    append_separator(out, i);
  }
  fmt::format_to(to, "}}\n{}}}\nobject {{ {} }}\n", texture, name);
}

}  // namespace octrace::exporters::povray
