// Parametric surfaces in double precision, and the scene that they are assembled into.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "backend/scene/scene.h"

namespace octrace::scene {

struct Mesh {
  std::vector<glm::dvec3> positions;
  std::vector<glm::dvec3> normals;  // empty: flat
  std::vector<glm::dvec2> uvs;      // empty: none
  std::vector<kernels::Triangle> triangles;
};

// All face outwards, are centred on the origin unless told, and have +Y for an axis.
Mesh make_sphere(double radius, int around, int rings);

// A surface of revolution through a profile of (radius, height) points from bottom to top; each
// stretch between points has normals of its own, so edges are sharp. Points of radius 0 close it.
Mesh make_lathe(std::span<const glm::dvec2> profile, int around);

// A box of half extents `half` whose edges and corners are rounded.
Mesh make_rounded_box(const glm::dvec3& half, double radius, int steps);

// The (p, q) torus knot: p turns about the axis, q about the tube of radius `minor`. The last ring
// and the last vertex of each ring repeat the first ones where `seams` is set, for texture
// coordinates; otherwise only the last ring does.
struct KnotShape {
  int p = 2, q = 3;
  double major = 1.0, minor = 0.4, tube = 0.2;
  int along = 64, around = 12;
  bool seams = true;
};
Mesh make_torus_knot(const KnotShape& shape);

// A w x h rectangle in the plane z = 0, facing +Z, bent about the y axis by `bend` turns over its
// height; uv (0, 0) is its top left corner.
Mesh make_card(double width, double height, double bend, int steps);

// Subdivided icosahedron without normals: flat facets.
Mesh make_facets(double radius, int subdivisions);

glm::dmat4 translated(const glm::dvec3& by);
glm::dmat4 turned(const glm::dvec3& axis, double turns);  // axis: unit

class SceneBuilder {
 public:
  std::uint32_t add_material(std::string name, const kernels::Material& material);
  // Rows from the top, R in the low byte; size width * height.
  std::uint32_t add_texture(std::uint32_t width, std::uint32_t height,
                            std::vector<std::uint32_t> texels, kernels::Wrap wrap);
  std::uint32_t add_object(std::string name);
  // Adds to the last object. The matrix must not mirror.
  void add_mesh(const Mesh& mesh, std::uint32_t material, const glm::dmat4& matrix);
  Scene& scene() { return scene_; }
  Scene finish() &&;

 private:
  Scene scene_;
};

}  // namespace octrace::scene
