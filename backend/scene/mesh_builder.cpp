#include "backend/scene/mesh_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <utility>

#include "backend/scene/exact_math.h"

namespace octrace::scene {

namespace {

using glm::dmat4;
using glm::dvec2;
using glm::dvec3;

dvec3 unit(const dvec3& v) { return v / std::sqrt(glm::dot(v, v)); }

// Two triangles for each cell of a grid of `columns` x `rows` vertices that starts at vertex
// `first`; columns run counter-clockwise about the outward normal seen with rows going up.
void stitch(Mesh& mesh, std::uint32_t first, int columns, int rows, bool wrap_columns) {
  const int cells = wrap_columns ? columns : columns - 1;
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i < cells; ++i) {
      const std::uint32_t a = first + j * columns + i;
      const std::uint32_t b = first + j * columns + (i + 1) % columns;
      const std::uint32_t c = a + columns, d = b + columns;
      const auto same = [&](std::uint32_t p, std::uint32_t q) {
        return mesh.positions[p] == mesh.positions[q];
      };
      if (!same(a, b)) mesh.triangles.push_back({a, b, d});
      if (!same(c, d)) mesh.triangles.push_back({a, d, c});
    }
  }
}

}  // namespace

Mesh make_sphere(double radius, int around, int rings) {
  Mesh mesh;
  for (int j = 0; j <= rings; ++j) {
    const SinCos polar = sin_cos_turns(0.5 * j / rings);
    // Exact poles, so that the cells there are triangles.
    const double ring = j == 0 || j == rings ? 0.0 : polar.sin;
    for (int i = 0; i <= around; ++i) {
      const SinCos turn = sin_cos_turns(static_cast<double>(i % around) / around);
      const dvec3 n(ring * turn.cos, -polar.cos, -ring * turn.sin);
      mesh.positions.push_back(n * radius);
      mesh.normals.push_back(n);
      mesh.uvs.push_back({static_cast<double>(i) / around, 1.0 - static_cast<double>(j) / rings});
    }
  }
  stitch(mesh, 0, around + 1, rings + 1, false);
  return mesh;
}

Mesh make_lathe(std::span<const dvec2> profile, int around) {
  Mesh mesh;
  for (std::size_t k = 0; k + 1 < profile.size(); ++k) {
    const dvec2 low = profile[k], high = profile[k + 1];
    const dvec2 along = high - low;
    const double length = std::sqrt(along.x * along.x + along.y * along.y);
    const dvec2 outward(along.y / length, -along.x / length);
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const dvec2& point : {low, high}) {
      for (int i = 0; i <= around; ++i) {
        const SinCos turn = sin_cos_turns(static_cast<double>(i % around) / around);
        mesh.positions.push_back({point.x * turn.cos, point.y, -point.x * turn.sin});
        mesh.normals.push_back({outward.x * turn.cos, outward.y, -outward.x * turn.sin});
        // Planar from above, in metres: what lies flat is what carries a pattern.
        mesh.uvs.push_back({point.x * turn.cos, -point.x * turn.sin});
      }
    }
    stitch(mesh, first, around + 1, 2, false);
  }
  return mesh;
}

Mesh make_rounded_box(const dvec3& half, double radius, int steps) {
  // A sphere of eight octants, pulled apart: the grid of each face of a cube, mapped to the sphere.
  Mesh mesh;
  const int n = 2 * steps + 2;  // vertices a side: two quarter arcs with a flat cell between
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2, next = (axis + 1) % 3, last = (axis + 2) % 3;
    const double side = face % 2 ? -1.0 : 1.0;
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const auto corner_and_angle = [&](int k) {
          // From -1 to 0 over the first arc, then from 0 to 1 over the second.
          return k <= steps ? std::pair(-1.0, -1.0 + static_cast<double>(k) / steps)
                            : std::pair(1.0, static_cast<double>(k - steps - 1) / steps);
        };
        const auto [corner_u, u] = corner_and_angle(i);
        const auto [corner_v, v] = corner_and_angle(j);
        const SinCos su = sin_cos_turns(u / 8.0), sv = sin_cos_turns(v / 8.0);
        dvec3 normal;
        normal[axis] = side;
        normal[next] = side * su.sin / su.cos;
        normal[last] = sv.sin / sv.cos;
        normal = unit(normal);
        dvec3 core = half - dvec3(radius);
        core[axis] *= side;
        core[next] *= side * corner_u;
        core[last] *= corner_v;
        mesh.positions.push_back(core + normal * radius);
        mesh.normals.push_back(normal);
        mesh.uvs.push_back(
            {static_cast<double>(i) / (n - 1), 1.0 - static_cast<double>(j) / (n - 1)});
      }
    }
    stitch(mesh, first, n, n, false);
  }
  return mesh;
}

Mesh make_torus_knot(const KnotShape& shape) {
  Mesh mesh;
  const int columns = shape.seams ? shape.around + 1 : shape.around;
  const auto curve = [&](double turns) {
    const SinCos about_axis = sin_cos_turns(shape.p * turns);
    const SinCos about_tube = sin_cos_turns(shape.q * turns);
    const double r = shape.major + shape.minor * about_tube.cos;
    return dvec3(r * about_axis.cos, r * about_axis.sin, shape.minor * about_tube.sin);
  };
  for (int j = 0; j <= shape.along; ++j) {
    const double t = static_cast<double>(j % shape.along) / shape.along;
    const dvec3 centre = curve(t);
    const double step = 1e-4;
    const dvec3 tangent = unit(curve(t + step) - curve(t - step));
    // The normal of the torus that the knot lies on closes up after one round without twist.
    const SinCos about_axis = sin_cos_turns(shape.p * t);
    const dvec3 out = unit(centre - shape.major * dvec3(about_axis.cos, about_axis.sin, 0.0));
    const dvec3 normal = unit(out - glm::dot(out, tangent) * tangent);
    const dvec3 binormal = glm::cross(tangent, normal);
    for (int i = 0; i < columns; ++i) {
      const SinCos turn = sin_cos_turns(static_cast<double>(i % shape.around) / shape.around);
      const dvec3 n = normal * turn.cos + binormal * turn.sin;
      mesh.positions.push_back(centre + n * shape.tube);
      mesh.normals.push_back(n);
      mesh.uvs.push_back(
          {static_cast<double>(j) / shape.along, static_cast<double>(i) / shape.around});
    }
  }
  stitch(mesh, 0, columns, shape.along + 1, !shape.seams);
  return mesh;
}

Mesh make_card(double width, double height, double bend, int steps) {
  Mesh mesh;
  for (int j = 0; j <= steps; ++j) {
    const double v = static_cast<double>(j) / steps;
    const SinCos turn = sin_cos_turns(bend * v);
    // An arc of the card's own height, leaning back as it rises; straight where it has no bend.
    const double radius = bend != 0.0 ? height / (bend * 6.283185307179586) : 0.0;
    const double y = bend != 0.0 ? radius * turn.sin : height * v;
    const double z = bend != 0.0 ? radius * (turn.cos - 1.0) : 0.0;
    for (int i = 0; i < 2; ++i) {
      mesh.positions.push_back({(i - 0.5) * width, y, z});
      mesh.normals.push_back({0.0, turn.sin, turn.cos});
      mesh.uvs.push_back({static_cast<double>(i), 1.0 - v});
    }
  }
  stitch(mesh, 0, 2, steps + 1, false);
  return mesh;
}

Mesh make_facets(double radius, int subdivisions) {
  const double g = 0.5 * (1.0 + std::sqrt(5.0));
  std::vector<dvec3> points = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                               {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                               {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  std::vector<kernels::Triangle> faces = {
      {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int round = 0; round < subdivisions; ++round) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [entry, added] = middles.try_emplace(std::minmax(a, b), points.size());
      if (added) points.push_back(0.5 * (unit(points[a]) + unit(points[b])));
      return entry->second;
    };
    std::vector<kernels::Triangle> finer;
    for (const auto& [a, b, c] : faces) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  Mesh mesh;
  for (const dvec3& p : points) mesh.positions.push_back(unit(p) * radius);
  mesh.triangles = std::move(faces);
  return mesh;
}

dmat4 translated(const dvec3& by) {
  dmat4 matrix(1.0);
  matrix[3] = glm::dvec4(by, 1.0);
  return matrix;
}

dmat4 turned(const dvec3& axis, double turns) {
  const auto [s, c] = sin_cos_turns(turns);
  dmat4 matrix(1.0);
  for (int column = 0; column < 3; ++column) {
    dvec3 e(0.0);
    e[column] = 1.0;
    matrix[column] =
        glm::dvec4(c * e + s * glm::cross(axis, e) + (1.0 - c) * axis[column] * axis, 0.0);
  }
  return matrix;
}

std::uint32_t SceneBuilder::add_material(std::string name, const kernels::Material& material) {
  scene_.material_names.push_back(std::move(name));
  scene_.materials.push_back(material);
  return static_cast<std::uint32_t>(scene_.materials.size() - 1);
}

std::uint32_t SceneBuilder::add_texture(std::uint32_t width, std::uint32_t height,
                                        std::vector<std::uint32_t> texels, kernels::Wrap wrap) {
  kernels::Texture texture{};
  texture.first_texel = scene_.texels.size();
  texture.width = width;
  texture.height = height;
  texture.wrap_s = texture.wrap_t = wrap;
  texture.filter = kernels::Filter::linear;
  texture.srgb = 1;
  scene_.texels.insert(scene_.texels.end(), texels.begin(), texels.end());
  scene_.textures.push_back(texture);
  return static_cast<std::uint32_t>(scene_.textures.size() - 1);
}

std::uint32_t SceneBuilder::add_object(std::string name) {
  scene_.object_names.push_back(std::move(name));
  return static_cast<std::uint32_t>(scene_.object_names.size() - 1);
}

void SceneBuilder::add_mesh(const Mesh& mesh, std::uint32_t material, const dmat4& matrix) {
  kernels::Geometry geometry{};
  geometry.first_triangle = static_cast<std::uint32_t>(scene_.triangles.size());
  geometry.triangle_count = static_cast<std::uint32_t>(mesh.triangles.size());
  geometry.first_vertex = static_cast<std::uint32_t>(scene_.positions.size());
  geometry.vertex_count = static_cast<std::uint32_t>(mesh.positions.size());
  geometry.object = static_cast<std::uint32_t>(scene_.object_names.size() - 1);
  geometry.material = material;
  geometry.tangents = geometry.uv1 = geometry.colors = kernels::kNone;
  geometry.normals =
      mesh.normals.empty() ? kernels::kNone : static_cast<std::uint32_t>(scene_.normals.size());
  geometry.uv0 = mesh.uvs.empty() ? kernels::kNone : static_cast<std::uint32_t>(scene_.uvs.size());

  const glm::dmat3 linear(matrix);
  const glm::dmat3 for_normals = glm::transpose(glm::inverse(linear));
  for (const dvec3& p : mesh.positions) {
    scene_.positions.push_back(kernels::Vec3(linear * p + dvec3(matrix[3])));
  }
  for (const dvec3& n : mesh.normals)
    scene_.normals.push_back(kernels::Vec3(unit(for_normals * n)));
  for (const dvec2& uv : mesh.uvs) scene_.uvs.push_back(kernels::Vec2(uv));
  for (const kernels::Triangle& t : mesh.triangles) {
    const std::uint32_t base = geometry.first_vertex;
    scene_.triangles.push_back({base + t.a, base + t.b, base + t.c});
  }
  scene_.triangle_geometry.insert(scene_.triangle_geometry.end(), mesh.triangles.size(),
                                  static_cast<std::uint32_t>(scene_.geometries.size()));
  scene_.geometries.push_back(geometry);
}

Scene SceneBuilder::finish() && {
  scene_.bounds = bounds_of(scene_.positions);
  return std::move(scene_);
}

}  // namespace octrace::scene
