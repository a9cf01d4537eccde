// The two generated scenes of the benchmark: a fractal terrain and a soup of small triangles.
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <cmath>
#include <limits>

#include "backend/scene/builtin.h"
#include "backend/scene/exact_math.h"

namespace octrace::scene {

namespace {

using glm::dvec3;

// One geometry of one object; the arrays of corners are the caller's.
Scene single_object(std::string name, std::uint32_t triangles, std::uint32_t vertices,
                    const kernels::Material& material) {
  Scene scene;
  scene.positions.resize(vertices);
  scene.triangles.resize(triangles);
  scene.triangle_geometry.assign(triangles, 0);
  kernels::Geometry geometry{};
  geometry.triangle_count = triangles;
  geometry.vertex_count = vertices;
  geometry.normals = geometry.tangents = geometry.uv0 = geometry.uv1 = geometry.colors =
      kernels::kNone;
  scene.geometries.push_back(geometry);
  scene.materials.push_back(material);
  scene.material_names.push_back(name);
  scene.object_names.push_back(std::move(name));

  kernels::Light sun{};
  sun.type = kernels::LightType::directional;
  const double inverse = 1.0 / std::sqrt(0.6 * 0.6 + 0.7 * 0.7 + 0.4 * 0.4);
  sun.direction = kernels::Vec3(dvec3(0.6, -0.7, 0.4) * inverse);
  sun.intensity = {3.0f, 2.8f, 2.4f};
  sun.range = std::numeric_limits<float>::infinity();
  scene.lights.push_back(sun);
  return scene;
}

kernels::Material rough(const kernels::Vec4& color) {
  kernels::Material material;
  material.base_color = color;
  material.metallic = 0.0f;
  material.roughness = 0.9f;
  material.double_sided = 1;  // the benchmark's rays see both sides
  return material;
}

// Value noise in [0, 1): random numbers at the lattice points, smooth steps between.
double value_noise(double x, double z) {
  const double cell_x = std::floor(x), cell_z = std::floor(z);
  const auto i = static_cast<std::uint32_t>(static_cast<std::int64_t>(cell_x));
  const auto k = static_cast<std::uint32_t>(static_cast<std::int64_t>(cell_z));
  const auto lattice = [](std::uint32_t a, std::uint32_t b) {
    return hash32(hash32(a * 0x9e3779b9u + 0x632be5abu) ^ (b * 0x85157af5u)) * 0x1p-32;
  };
  const double fx = x - cell_x, fz = z - cell_z;
  const double sx = fx * fx * (3.0 - 2.0 * fx), sz = fz * fz * (3.0 - 2.0 * fz);
  const double near = lattice(i, k) + (lattice(i + 1, k) - lattice(i, k)) * sx;
  const double far = lattice(i, k + 1) + (lattice(i + 1, k + 1) - lattice(i, k + 1)) * sx;
  return near + (far - near) * sz;
}

double ridged_noise(double x, double z) {
  double sum = 0.0, amplitude = 1.0, frequency = 1.0;
  for (int octave = 0; octave < 9; ++octave) {
    const double ridge = 1.0 - std::abs(2.0 * value_noise(x * frequency, z * frequency) - 1.0);
    sum += amplitude * ridge * ridge;
    amplitude *= 0.48;
    frequency *= 2.03;
  }
  return sum;
}

}  // namespace

Scene make_terrain_scene(std::uint32_t n) {
  const std::uint32_t side = n + 1;
  Scene scene =
      single_object("terrain", 2 * n * n, side * side, rough({0.42f, 0.36f, 0.28f, 1.0f}));
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, side), [&](const auto& rows) {
    for (std::uint32_t j = rows.begin(); j != rows.end(); ++j) {
      const double z = 16.0 * j / n;
      for (std::uint32_t i = 0; i < side; ++i) {
        const double x = 16.0 * i / n;
        const double y = 1.5 * ridged_noise(0.5 * x, 0.5 * z);
        scene.positions[std::size_t{j} * side + i] = kernels::Vec3(dvec3(x, y, z));
        if (i == n || j == n) continue;
        const std::uint32_t a = j * side + i, b = a + 1, c = a + side, d = c + 1;
        const std::size_t quad = std::size_t{j} * n + i;
        scene.triangles[2 * quad] = {a, c, b};
        scene.triangles[2 * quad + 1] = {b, c, d};
      }
    }
  });
  scene.bounds = bounds_of(scene.positions);
  Camera camera = look_at({1.0, 5.0, 1.0}, {8.0, 1.5, 8.0}, 60.0 / 180.0 * 3.141592653589793);
  camera.name = "bench";
  scene.cameras.push_back(camera);
  return scene;
}

Scene make_soup_scene(std::uint32_t count) {
  Scene scene = single_object("soup", count, 3 * count, rough({0.75f, 0.55f, 0.2f, 1.0f}));
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count), [&](const auto& range) {
    for (std::uint32_t t = range.begin(); t != range.end(); ++t) {
      std::uint32_t drawn = 0;
      const auto centred = [&] { return 2.0 * uniform(t, drawn++) - 1.0; };
      const auto in_cube = [&] {
        const double x = centred(), y = centred(), z = centred();
        return dvec3(x, y, z);
      };
      dvec3 first = in_cube();  // by rejection: 52 % of the cube is ball
      while (first.x * first.x + first.y * first.y + first.z * first.z > 1.0) first = in_cube();
      scene.positions[3 * std::size_t{t}] = kernels::Vec3(first);
      scene.positions[3 * std::size_t{t} + 1] = kernels::Vec3(first + 0.01 * in_cube());
      scene.positions[3 * std::size_t{t} + 2] = kernels::Vec3(first + 0.01 * in_cube());
      scene.triangles[t] = {3 * t, 3 * t + 1, 3 * t + 2};
    }
  });
  scene.bounds = bounds_of(scene.positions);
  Camera camera = look_at({0.5, 0.4, 2.2}, dvec3(0.0), 50.0 / 180.0 * 3.141592653589793);
  camera.name = "bench";
  scene.cameras.push_back(camera);
  return scene;
}

}  // namespace octrace::scene
