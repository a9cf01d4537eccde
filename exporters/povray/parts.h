// The pieces that a .pov is put together from. Text is appended to one string; numbers are printed
// by fmt, which never asks the locale.
#pragma once

#include <cmath>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "backend/scene/scene.h"
#include "backend/util/result.h"
#include "exporters/camera_frame.h"
#include "exporters/povray/povray.h"
#include "exporters/text.h"

namespace octrace::exporters::povray {

// POV-Ray works at radius 10 about the origin: it drops geometry outside of about 1e-4 to 1e7 units
// and keeps mesh corners as floats. The scale is a power of two, so that only the shift can round.
struct Fit {
  glm::dvec3 centre{0.0};
  double scale = 1.0;

  glm::dvec3 operator()(const glm::dvec3& point) const { return (point - centre) * scale; }
  // As POV-Ray will hold it.
  glm::dvec3 corner(const kernels::Vec3& point) const {
    return glm::dvec3(glm::vec3((*this)(glm::dvec3(point))));
  }
};
inline constexpr double kRadius = 10.0;
Fit fit_bounds(const scene::Bounds& bounds);

// Everything that writers need to know, and where they leave files and remarks.
struct Job {
  const scene::Scene& scene;
  const PovrayOptions& options;
  Fit fit;
  CameraFrame frame;                                // in POV-Ray's units
  double znear = 0.0, zfar = 0.0, depth_far = 1.0;  // in POV-Ray's units
  PathParts path;
  PovrayFile result;

  void note(const std::string& line);  // once
};

// Whether a triangle shows the camera its back: exact where every ray has one origin or direction.
// POV-Ray's own means, a clear interior_texture, loses surfaces within 1e-4 units behind what it
// passes through, and so all coincident pairs of sheets.
bool faces_away(const Job& job, const kernels::Triangle& triangle);

// ---- mesh.cpp
struct MeshStyle {
  const kernels::TextureRef* uv = nullptr;  // whose coordinates the mesh carries; null: none
  bool normals = false;
  bool drop_back_faces = false;
  bool reversed = false;  // corners as a, c, b: the glTF front becomes POV-Ray's outside
  // The texture_list: one entry a kept triangle, or, where vertex_textures says so, shared by
  // vertices and blended between them. Empty: the object's texture alone.
  std::vector<std::string> textures;
  std::vector<std::uint32_t> vertex_textures;  // by vertex of the geometry
};
// Indices of the geometry's triangles that the mesh will hold.
std::vector<std::uint32_t> kept_triangles(const Job& job, const kernels::Geometry& geometry,
                                          const MeshStyle& style);
// "#declare NAME = mesh2 {...TEXTURE}" and "object { NAME }".
void append_mesh(std::string& out, const Job& job, std::uint32_t geometry, const MeshStyle& style,
                 const std::vector<std::uint32_t>& triangles, const std::string& texture);
std::string mesh_name(const Job& job, std::uint32_t geometry);
// The texture coordinates of one vertex as the reference transforms them; (0, 0) where it has none.
glm::dvec2 vertex_uv(const scene::Scene& scene, const kernels::Geometry& geometry,
                     const kernels::TextureRef& ref, std::uint32_t vertex);

// ---- alpha_map.cpp: functions CutN(u, v, w), 0.25 where material N is cut out at texture
// coordinates (u, v) and vertex alpha w, else 0.75.
util::Result<void> append_cut_functions(std::string& out, Job& job);
bool is_cut(const Job& job, const kernels::Material& material);

// ---- depth_material.cpp
void append_depth_header(std::string& out, const Job& job);
void append_depth_mesh(std::string& out, Job& job, std::uint32_t geometry);

// ---- scene_material.cpp, scene_light.cpp
util::Result<void> append_scene_header(std::string& out, Job& job);
void append_scene_mesh(std::string& out, Job& job, std::uint32_t geometry);
void append_lights(std::string& out, Job& job);

// ---- texture_file.cpp
// A texture times a factor as an image_map whose unit square lies where texture coordinates ask for
// it: mirrored and clamped textures are drawn out, because POV-Ray only repeats.
struct ImageMap {
  std::string pigment;  // "image_map {...} scale ... translate ...", in texture coordinates
};
enum class MapUse { color, color_and_alpha };
util::Result<ImageMap> write_image_map(Job& job, std::uint32_t material,
                                       const kernels::TextureRef& ref, const glm::dvec4& factor,
                                       MapUse use, const char* label);

}  // namespace octrace::exporters::povray
