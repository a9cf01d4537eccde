#include "tests/support/instanced_scene.h"

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <random>

namespace octrace::tests {

using scene::testing::GltfFile;
using scene::testing::json;

std::vector<float> bumpy_ball(float centre, bool flat) {
  std::vector<float> corners;
  constexpr int kAround = 9, kRings = 6;
  const auto add = [&](int ring, int i) {
    const double polar = M_PI * ring / kRings, turn = 2 * M_PI * (i % kAround) / kAround;
    const double r = 1.0 + 0.3 * std::sin(3 * turn) * std::sin(polar);
    corners.push_back(static_cast<float>(centre + r * std::sin(polar) * std::cos(turn)));
    corners.push_back(static_cast<float>(centre + 0.7 * std::cos(polar)));
    corners.push_back(
        static_cast<float>(flat ? centre : centre + r * std::sin(polar) * std::sin(turn)));
  };
  for (int ring = 0; ring < kRings; ++ring) {
    for (int i = 0; i < kAround; ++i) {
      add(ring, i), add(ring, i + 1), add(ring + 1, i + 1);
      add(ring, i), add(ring + 1, i + 1), add(ring + 1, i);
    }
  }
  return corners;
}

GltfFile make_instanced_file(const InstanceShape& shape, int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<float> translations, rotations, scales;
  const double spread = shape.size * std::cbrt(count);
  for (int i = 0; i < count; ++i) {
    glm::dvec4 q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    q = glm::normalize(q);
    for (int k = 0; k < 4; ++k) rotations.push_back(static_cast<float>(q[k]));
    glm::dvec3 place, size;
    for (int k = 0; k < 3; ++k) {
      place[k] = uniform(-spread, spread);
      double s = shape.size * uniform(shape.scale[0], shape.scale[1]);
      if (shape.mirrors && uniform(0, 1) < 0.5) s = -s;
      if (shape.flat && k == 2) s = 0.0;
      size[k] = static_cast<float>(s);
    }
    // Wherever the mesh lies in its own units, its instances lie about the origin.
    place -= glm::dquat(q.w, q.x, q.y, q.z) * (size * double{shape.centre});
    for (int k = 0; k < 3; ++k) {
      translations.push_back(static_cast<float>(place[k]));
      scales.push_back(static_cast<float>(size[k]));
    }
  }
  GltfFile file;
  const int mesh = file.mesh(bumpy_ball(shape.centre, shape.flat));
  const auto s = static_cast<float>(2 * spread);
  const int floor = file.mesh({-s, -s, -s, s, -s, s, s, -s, -s, -s, -s, -s, -s, -s, s, s, -s, s});
  json node = {{"name", "ball"}, {"mesh", mesh}};
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", file.floats("VEC3", translations)},
      {"ROTATION", file.floats("VEC4", rotations)},
      {"SCALE", file.floats("VEC3", scales)}};
  const int ball = file.append("nodes", node);
  json parent = {{"children", json::array({ball})}};
  if (!shape.parent.is_null()) parent["matrix"] = shape.parent;
  const int top = file.append("nodes", parent);
  const int plain = file.append("nodes", {{"mesh", floor}});
  file.append("scenes", {{"nodes", json::array({top, plain})}});
  return file;
}

scene::Scene make_instanced_scene(const InstanceShape& shape, int count, std::uint64_t seed) {
  return make_instanced_file(shape, count, seed).scene();
}

std::vector<InstanceShape> instance_shapes() {
  InstanceShape plain{"Plain"}, mirrored{"Mirrored"}, tiny{"Tiny"}, huge{"Huge"},
      sheared{"Sheared"}, wide{"ScalesFarApart"}, away{"MeshFarFromItsOrigin"},
      flat{"FlatMeshScaledBy0"};
  mirrored.mirrors = true;
  tiny.size = 1e-5;
  huge.size = 1e6;
  sheared.parent = {1, 0, 0, 0, 0.9, 1, 0, 0, 0.3, -2, 0.05, 0, 3, 1, 2, 1};
  sheared.mirrors = true;
  wide.scale = {0.002f, 2.0f};
  away.centre = 3000.0f;
  flat.flat = true;
  return {plain, mirrored, tiny, huge, sheared, wide, away, flat};
}

}  // namespace octrace::tests
