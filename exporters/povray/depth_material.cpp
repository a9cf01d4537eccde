#include <fmt/format.h>

#include <array>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <iterator>

#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

constexpr const char* kClear = "pigment { rgbt <0,0,0,1> } finish { ambient 0 diffuse 0 }";

// An average of three pigments divides each by 3. The mask needs no channel of its own: ids start
// at 1.
std::string encoding(std::uint32_t id) {
  return fmt::format("average pigment_map {{ [1 High] [1 Low] [1 rgb <0,0,3*{}/65535>] }}", id);
}

constexpr const char* kGlow = "finish { emission 1 ambient 0 diffuse 0 }";

// f(p) = gradient . p + offset, equal to the values at the corners.
struct Affine {
  glm::dvec3 gradient{0.0};
  double offset = 0.0;
};

Affine affine_over(const std::array<glm::dvec3, 3>& p, const std::array<double, 3>& value) {
  const glm::dvec3 ab = p[1] - p[0], ac = p[2] - p[0];
  const glm::dvec3 normal = glm::cross(ab, ac);
  const double area2 = glm::dot(normal, normal);
  Affine f;
  if (area2 > 0.0) {
    f.gradient = ((value[1] - value[0]) * glm::cross(ac, normal) +
                  (value[2] - value[0]) * glm::cross(normal, ab)) /
                 area2;
  }
  f.offset = value[0] - glm::dot(f.gradient, p[0]);
  return f;
}

std::string expression(const Affine& f) {
  return fmt::format("({:.17g}*x+{:.17g}*y+{:.17g}*z+{:.17g})", f.gradient.x, f.gradient.y,
                     f.gradient.z, f.offset);
}

// A pigment sees either texture coordinates or the point in space, and a cut-out surface that
// encodes its depth needs both. Within one triangle the first are affine functions of the second,
// so every triangle gets a texture of its own.
std::vector<std::string> cut_textures(const Job& job, const kernels::Geometry& geometry,
                                      const std::vector<std::uint32_t>& triangles) {
  const scene::Scene& scene = job.scene;
  const kernels::Material& material = scene.materials[geometry.material];
  std::vector<std::string> textures;
  textures.reserve(triangles.size());
  for (const std::uint32_t index : triangles) {
    const kernels::Triangle& t = scene.triangles[index];
    const std::array<std::uint32_t, 3> corners{t.a, t.b, t.c};
    std::array<glm::dvec3, 3> point;
    std::array<double, 3> u, v, w;
    for (std::size_t c = 0; c < 3; ++c) {
      point[c] = job.fit.corner(scene.positions[corners[c]]);
      const glm::dvec2 uv = vertex_uv(scene, geometry, material.base_color_texture, corners[c]);
      u[c] = uv.x;
      v[c] = uv.y;
      w[c] =
          geometry.colors == kernels::kNone
              ? 1.0
              : scene.colors[std::size_t{geometry.colors} + corners[c] - geometry.first_vertex].w;
    }
    textures.push_back(fmt::format(
        "texture {{ pigment {{ function {{ Cut{}({},{},{}) }} pigment_map {{ [0.5 rgbt <0,0,0,1>] "
        "[0.5 {}] }} }} {} }}",
        geometry.material, expression(affine_over(point, u)), expression(affine_over(point, v)),
        expression(affine_over(point, w)), fmt::format("Encode{}", geometry.object), kGlow));
  }
  return textures;
}

}  // namespace

void append_depth_header(std::string& out, const Job& job) {
  const glm::dvec3 axis = -job.frame.back;
  auto to = std::back_inserter(out);
  fmt::format_to(to,
                 "\n#declare Depth = function(x,y,z) {{ "
                 "(x-({:.17g}))*({:.17g})+(y-({:.17g}))*({:.17g})+(z-({:.17g}))*({:.17g}) }}\n",
                 job.frame.eye.x, axis.x, job.frame.eye.y, axis.y, job.frame.eye.z, axis.z);
  fmt::format_to(to,
                 "#declare Steps = function(x,y,z) {{ "
                 "min(max(floor(Depth(x,y,z)/({:.17g})*{:.0f}+0.5),0),{:.0f}) }}\n",
                 job.depth_far, kPovrayDepthSteps, kPovrayDepthSteps - 1.0);
  // A pattern's values lie in [0, 1); 65536 = 2^16 keeps them exact, and 65535 is what a channel of
  // the PNG is multiplied by.
  fmt::format_to(to,
                 "#declare High = pigment {{ function {{ floor(Steps(x,y,z)/{0})/65536 }} "
                 "color_map {{ [0 rgb 0] [1 rgb <3*65536/65535,0,0>] }} }}\n"
                 "#declare Low = pigment {{ function {{ mod(Steps(x,y,z),{0})/65536 }} "
                 "color_map {{ [0 rgb 0] [1 rgb <0,3*65536/65535,0>] }} }}\n",
                 kPovrayHalf);

  std::vector<bool> declared;
  for (const kernels::Geometry& geometry : job.scene.geometries) {
    if (geometry.object >= declared.size()) declared.resize(geometry.object + 1, false);
    if (declared[geometry.object]) continue;
    declared[geometry.object] = true;
    const std::string code = encoding(geometry.object + 1);
    const bool clipped = job.znear > 0.0 || std::isfinite(job.zfar);
    if (!clipped) {
      fmt::format_to(to, "#declare Encode{} = pigment {{ {} }}\n", geometry.object, code);
      continue;
    }
    std::string inside = fmt::format("select(Depth(x,y,z)-({:.17g}),0.25,0.75)", job.znear);
    if (std::isfinite(job.zfar)) {
      inside = fmt::format("min({},select({:.17g}-Depth(x,y,z),0.25,0.75))", inside, job.zfar);
    }
    fmt::format_to(to,
                   "#declare Encode{} = pigment {{ function {{ {} }} pigment_map {{ "
                   "[0.5 rgbt <0,0,0,1>] [0.5 {}] }} }}\n",
                   geometry.object, inside, code);
  }
}

void append_depth_mesh(std::string& out, Job& job, std::uint32_t index) {
  const kernels::Geometry& geometry = job.scene.geometries[index];
  const kernels::Material& material = job.scene.materials[geometry.material];
  const bool culled = job.options.cull && material.double_sided == 0;
  MeshStyle style;
  style.drop_back_faces = culled;
  const std::vector<std::uint32_t> triangles = kept_triangles(job, geometry, style);
  if (is_cut(job, material)) {
    style.textures = cut_textures(job, geometry, triangles);
    append_mesh(out, job, index, style, triangles, "");
    return;
  }
  const std::string shown = fmt::format("{{ pigment {{ Encode{} }} {} }}", geometry.object, kGlow);
  const std::string texture =
      culled ? fmt::format("texture {{ {} }}\ninterior_texture {}\n", kClear, shown)
             : fmt::format("texture {}\n", shown);
  append_mesh(out, job, index, style, triangles, texture);
}

}  // namespace octrace::exporters::povray
