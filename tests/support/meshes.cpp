#include "tests/support/meshes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace octrace::tests {

using kernels::Ray;
using kernels::Triangle;
using kernels::Vec3;

namespace {

float uniform(std::mt19937_64& random, float low, float high) {
  return low + (high - low) * static_cast<float>(random() >> 40) * 0x1p-24f;
}

Vec3 in_cube(std::mt19937_64& random, float radius) {
  return {uniform(random, -radius, radius), uniform(random, -radius, radius),
          uniform(random, -radius, radius)};
}

void add_triangle(Mesh& mesh, Vec3 a, Vec3 b, Vec3 c) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

Mesh make_soup(int count, float size) {
  Mesh mesh{"soup", {}, {}};
  std::mt19937_64 random(1);
  for (int i = 0; i < count; ++i) {
    const Vec3 a = in_cube(random, 1.0f);
    add_triangle(mesh, a, a + in_cube(random, size), a + in_cube(random, size));
  }
  return mesh;
}

Mesh make_slivers() {
  Mesh mesh{"slivers", {}, {}};
  std::mt19937_64 random(2);
  for (int i = 0; i < 300; ++i) {
    const Vec3 a = in_cube(random, 1.0f), b = in_cube(random, 1.0f);
    add_triangle(mesh, a, b, b + in_cube(random, std::exp2(-uniform(random, 5.0f, 24.0f))));
  }
  return mesh;
}

Mesh make_duplicates() {
  Mesh mesh{"duplicates", {}, {}};
  std::mt19937_64 random(3);
  for (int i = 0; i < 20; ++i) {
    const Vec3 a = in_cube(random, 1.0f), b = in_cube(random, 1.0f), c = in_cube(random, 1.0f);
    for (int copy = 0; copy < 20; ++copy) add_triangle(mesh, a, b, c);
  }
  return mesh;
}

Mesh make_coplanar() {
  Mesh mesh{"coplanar grids", {}, {}};
  for (const float height : {0.0f, 0.0f, 0.5f}) {
    const Mesh grid = make_grid(12, height, 1.0f);
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), grid.positions.begin(), grid.positions.end());
    for (const Triangle& t : grid.triangles) {
      mesh.triangles.push_back({first + t.a, first + t.b, first + t.c});
    }
  }
  return mesh;
}

Mesh make_degenerate() {
  Mesh mesh = make_soup(200, 0.3f);
  mesh.name = "degenerate";
  std::mt19937_64 random(4);
  for (int i = 0; i < 100; ++i) {
    const Vec3 a = in_cube(random, 1.0f), b = in_cube(random, 1.0f);
    add_triangle(mesh, a, a, a);
    add_triangle(mesh, a, b, a);
    add_triangle(mesh, a, b, a + 0.5f * (b - a));
  }
  return mesh;
}

Mesh make_fan() {
  Mesh mesh{"fan", {{0.0f, 0.0f, 0.3f}}, {}};
  constexpr std::uint32_t kSpokes = 700;
  for (std::uint32_t i = 0; i < kSpokes; ++i) {
    const float angle = 6.2831853f * static_cast<float>(i) / kSpokes;
    mesh.positions.push_back({std::cos(angle), std::sin(angle), 0.0f});
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % kSpokes});
  }
  return mesh;
}

Mesh make_mixed_scales() {
  Mesh mesh{"mixed scales", {}, {}};
  std::mt19937_64 random(5);
  for (int i = 0; i < 400; ++i) {
    const float size = std::exp2(uniform(random, -20.0f, 6.0f));
    const Vec3 a = in_cube(random, size);
    add_triangle(mesh, a, a + in_cube(random, size), a + in_cube(random, size));
  }
  return mesh;
}

Mesh moved(Mesh mesh, Vec3 offset) {
  mesh.name += " at 1e5";
  for (Vec3& p : mesh.positions) p += offset;
  return mesh;
}

}  // namespace

Mesh make_sphere(int rings, Vec3 centre, float radius) {
  Mesh mesh{"sphere", {}, {}};
  const int sectors = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const float theta = 3.14159265f * static_cast<float>(i) / static_cast<float>(rings);
      const float phi = 6.2831853f * static_cast<float>(j) / static_cast<float>(sectors);
      mesh.positions.push_back(centre + radius * Vec3(std::sin(theta) * std::cos(phi),
                                                      std::cos(theta),
                                                      std::sin(theta) * std::sin(phi)));
    }
  }
  const auto at = [&](int i, int j) {
    return static_cast<std::uint32_t>(i * sectors + j % sectors);
  };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return mesh;
}

Mesh make_grid(int n, float height, float size) {
  Mesh mesh{"grid", {}, {}};
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      mesh.positions.push_back({size * static_cast<float>(i) / static_cast<float>(n), height,
                                size * static_cast<float>(j) / static_cast<float>(n)});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * (n + 1) + j); };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      mesh.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return mesh;
}

std::vector<Mesh> hard_meshes() {
  const Vec3 far(1e5f, -1e5f, 1e5f);
  return {make_sphere(12, Vec3(0.0f), 1.0f),
          make_soup(600, 0.2f),
          make_slivers(),
          make_duplicates(),
          make_coplanar(),
          make_degenerate(),
          make_fan(),
          make_mixed_scales(),
          moved(make_soup(400, 0.3f), far),
          moved(make_coplanar(), far)};
}

Ray random_ray(const Mesh& mesh, const octree::Octree& octree, std::mt19937_64& random) {
  const auto pick = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const Triangle& t = mesh.triangles[pick(mesh.triangles.size())];
  const Vec3 a = mesh.positions[t.a], b = mesh.positions[t.b], c = mesh.positions[t.c];
  float wb = uniform(random, 0.0f, 1.0f), wc = uniform(random, 0.0f, 1.0f - wb);
  switch (pick(4)) {  // a point inside, at a corner, on an edge, or nearby
    case 0:
      wb = 0.0f, wc = 0.0f;
      break;
    case 1:
      wc = 0.0f;
      break;
    case 2:
      wb = uniform(random, -1.0f, 2.0f), wc = uniform(random, -1.0f, 2.0f);
      break;
    default:
      break;
  }
  const Vec3 target = a + wb * (b - a) + wc * (c - a);
  const float reach = std::exp2(uniform(random, -3.0f, 4.0f));
  Vec3 origin = target + in_cube(random, reach);
  Vec3 direction = target - origin;
  switch (pick(7)) {
    case 0: {  // along an axis, exactly
      const int axis = static_cast<int>(pick(3));
      direction = Vec3(0.0f);
      direction[axis] = random() & 1 ? 1.0f : -1.0f;
      origin = target;
      origin[axis] -= direction[axis] * reach;
      break;
    }
    case 1: {  // within a plane of some child box
      const kernels::Node& node = octree.nodes[pick(octree.nodes.size())];
      const int axis = static_cast<int>(pick(3)), slot = static_cast<int>(pick(8));
      origin[axis] = node.origin[axis] + static_cast<float>(node.lower[axis][slot]) *
                                             std::exp2(static_cast<float>(node.exponent[axis]));
      direction = target - origin;
      direction[axis] = random() & 1 ? 0.0f : -0.0f;
      break;
    }
    case 2:  // from a surface
      origin = target;
      direction = in_cube(random, 1.0f);
      break;
    case 3: {  // nearly along an axis, or nearly in a plane of two
      const int axis = static_cast<int>(pick(3));
      direction[axis] = std::copysign(reach, direction[axis]);
      for (int other = 0; other < 3; ++other) {
        if (other != axis) direction[other] *= std::exp2(-uniform(random, 0.0f, 40.0f));
      }
      origin = target - direction;
      break;
    }
    default:
      break;
  }
  const float length =
      std::sqrt(direction.x * direction.x + direction.y * direction.y + direction.z * direction.z);
  if (!(length > 0.0f)) direction = Vec3(0.0f, 0.0f, 1.0f);
  if (length > 0.0f && (random() & 1)) direction /= length;
  const float largest =
      std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
  if (largest < 1e-5f) direction /= largest;
  Ray ray{origin, 0.0f, direction, std::numeric_limits<float>::infinity()};
  if (pick(8) == 0) ray.tmin = uniform(random, 0.0f, 2.0f);
  if (pick(8) == 0) ray.tmax = ray.tmin + uniform(random, 0.0f, 2.0f);
  return ray;
}

}  // namespace octrace::tests
