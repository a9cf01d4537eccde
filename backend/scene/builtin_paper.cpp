// The seed's experiment: 855 vertices, 1692 triangles, seen from (0, 0, Z) for four values of Z.
// Its own model is not published; this one is a trefoil knot of 95 rings of 9 vertices, the last
// ring on the first, so that 95 * 9 = 855 and 2 * 94 * 9 = 1692.
#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "backend/scene/builtin.h"
#include "backend/scene/exact_math.h"
#include "backend/scene/mesh_builder.h"

namespace octrace::scene {

Scene make_paper_scene() {
  SceneBuilder builder;
  kernels::Material clay;
  clay.base_color = {0.78f, 0.42f, 0.25f, 1.0f};
  clay.metallic = 0.0f;
  clay.roughness = 0.45f;
  const std::uint32_t material = builder.add_material("clay", clay);

  KnotShape knot;
  knot.major = 95.0;
  knot.minor = 38.0;
  knot.tube = 22.0;
  knot.along = 94;
  knot.around = 9;
  knot.seams = false;
  builder.add_object("knot");
  // A quarter of a lobe, so that the image is upright and symmetric.
  builder.add_mesh(make_torus_knot(knot), material, turned({0, 0, 1}, 0.25));

  kernels::Light sun{};
  sun.type = kernels::LightType::directional;
  const double inverse = 1.0 / std::sqrt(0.5 * 0.5 + 0.8 * 0.8 + 0.6 * 0.6);
  sun.direction = kernels::Vec3(glm::dvec3(-0.5, -0.8, -0.6) * inverse);
  sun.intensity = kernels::Vec3(2.6f);
  sun.range = std::numeric_limits<float>::infinity();
  builder.scene().lights.push_back(sun);

  for (const int z : {700, 600, 500, 400}) {
    Camera camera = look_at({0.0, 0.0, static_cast<double>(z)}, glm::dvec3(0.0), 0.8);
    camera.name = fmt::format("Z{}", z);
    camera.znear = 1.0;
    builder.scene().cameras.push_back(camera);
  }
  return std::move(builder).finish();
}

}  // namespace octrace::scene
