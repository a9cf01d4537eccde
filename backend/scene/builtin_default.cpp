// builtin:default, a still life on a round stage that shows what the renderer does: metals and
// dielectrics from smooth to rough, a procedural texture, foliage cut out by an alpha mask, a
// blended pane, an emissive lamp, an unlit backdrop, flat facets, all three kinds of light.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "backend/scene/builtin.h"
#include "backend/scene/exact_math.h"
#include "backend/scene/mesh_builder.h"

namespace octrace::scene {

namespace {

using glm::dmat4;
using glm::dvec2;
using glm::dvec3;
using kernels::Material;
using kernels::Vec3;
using kernels::Vec4;

constexpr dvec3 kUp(0.0, 1.0, 0.0);

Material dielectric(const Vec3& color, float roughness) {
  Material material;
  material.base_color = Vec4(color, 1.0f);
  material.metallic = 0.0f;
  material.roughness = roughness;
  return material;
}

Material metal(const Vec3& color, float roughness) {
  Material material;
  material.base_color = Vec4(color, 1.0f);
  material.metallic = 1.0f;
  material.roughness = roughness;
  return material;
}

std::uint32_t rgba(int r, int g, int b, int a) {
  return static_cast<std::uint32_t>(r) | static_cast<std::uint32_t>(g) << 8 |
         static_cast<std::uint32_t>(b) << 16 | static_cast<std::uint32_t>(a) << 24;
}

// Two by two tiles in two tones, each a little different, with a joint between them.
std::vector<std::uint32_t> tile_texels(std::uint32_t size) {
  std::vector<std::uint32_t> texels;
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const std::uint32_t half = size / 2, joint = size / 64;
      const bool dark = (x / half + y / half) % 2 != 0;
      const bool edge = x % half < joint || y % half < joint;
      const int grain = static_cast<int>(uniform(1, y * size + x) * 9.0) - 4;
      const int shade = (edge ? -46 : 0) + grain;
      texels.push_back(dark ? rgba(204 + shade, 190 + shade, 172 + shade, 255)
                            : rgba(238 + shade, 229 + shade, 214 + shade, 255));
    }
  }
  return texels;
}

// A pinnate leaf, its stalk at the bottom: alpha is the outline, with a notch between the leaflets.
std::vector<std::uint32_t> leaf_texels(std::uint32_t size) {
  std::vector<std::uint32_t> texels;
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      const double u = std::abs((x + 0.5) / size * 2.0 - 1.0);  // 0 at the midrib
      const double v = 1.0 - (y + 0.5) / size;                  // 0 at the stalk
      const double width = 4.0 * v * (1.0 - v) * (1.15 - 0.45 * v) * 0.9;
      // Leaflets slant upwards: their phase runs with v and against u.
      const double phase = v * 9.0 - u * 1.6;
      const double notch = std::abs(phase - std::floor(phase) - 0.5) * 2.0;
      const bool blade = u < width * (1.0 - 0.55 * notch * notch * notch) && v > 0.06;
      const bool stalk = u < 0.028 && v < 0.97;
      const int light = static_cast<int>(26.0 * (1.0 - notch) + 24.0 * v);
      const bool rib = u < 0.022;
      texels.push_back(rgba((rib ? 150 : 44) + light, (rib ? 176 : 112) + light, 62 + light / 3,
                            blade || stalk ? 255 : 0));
    }
  }
  return texels;
}

void add_stage(SceneBuilder& scene) {
  Material tiles = dielectric(Vec3(1.0f), 0.55f);
  tiles.base_color_texture.texture =
      scene.add_texture(256, 256, tile_texels(256), kernels::Wrap::repeat);
  tiles.base_color_texture.transform_u = {0.7f, 0.0f, 0.0f};  // tiles of 0.71 m
  tiles.base_color_texture.transform_v = {0.0f, 0.7f, 0.0f};
  const auto tile_material = scene.add_material("tiles", tiles);
  const auto rim_material = scene.add_material("rim", dielectric({0.055f, 0.075f, 0.13f}, 0.35f));
  const auto strip_material = scene.add_material("strip", metal({0.93f, 0.68f, 0.36f}, 0.28f));

  scene.add_object("stage");
  const std::array<dvec2, 2> top = {dvec2(3.15, 0.0), dvec2(0.0, 0.0)};
  scene.add_mesh(make_lathe(top, 128), tile_material, dmat4(1.0));
  scene.add_object("rim");
  const std::array<dvec2, 8> rim = {dvec2(0.0, -0.36),  dvec2(3.44, -0.36), dvec2(3.48, -0.32),
                                    dvec2(3.48, -0.17), dvec2(3.3, -0.17),  dvec2(3.3, -0.04),
                                    dvec2(3.26, 0.0),   dvec2(3.2, 0.0)};
  scene.add_mesh(make_lathe(rim, 128), rim_material, dmat4(1.0));
  const std::array<dvec2, 4> strip = {dvec2(3.205, 0.0), dvec2(3.195, 0.012), dvec2(3.155, 0.012),
                                      dvec2(3.145, 0.0)};
  scene.add_mesh(make_lathe(strip, 128), strip_material, dmat4(1.0));
}

void add_knot(SceneBuilder& scene) {
  const auto stone = scene.add_material("stone", dielectric({0.86f, 0.83f, 0.78f}, 0.7f));
  const auto gold = scene.add_material("gold", metal({1.0f, 0.74f, 0.32f}, 0.24f));
  const dvec3 foot(0.0, 0.0, -0.75);
  scene.add_object("pedestal");
  const std::array<dvec2, 12> profile = {dvec2(0.0, 0.0),   dvec2(0.78, 0.0),  dvec2(0.8, 0.02),
                                         dvec2(0.8, 0.13),  dvec2(0.77, 0.16), dvec2(0.66, 0.18),
                                         dvec2(0.62, 0.22), dvec2(0.6, 0.62),  dvec2(0.68, 0.68),
                                         dvec2(0.7, 0.7),   dvec2(0.7, 0.76),  dvec2(0.68, 0.78)};
  scene.add_mesh(make_lathe(profile, 96), stone, translated(foot));
  const std::array<dvec2, 2> lid = {dvec2(0.68, 0.78), dvec2(0.0, 0.78)};
  scene.add_mesh(make_lathe(lid, 96), stone, translated(foot));

  scene.add_object("knot");
  KnotShape knot;
  knot.major = 0.62;
  knot.minor = 0.27;
  knot.tube = 0.135;
  knot.along = 360;
  knot.around = 32;
  const Mesh mesh = make_torus_knot(knot);
  const dmat4 upright = turned(kUp, 0.04) * turned({0, 0, 1}, 0.25);
  double lowest = 0.0;
  for (const dvec3& p : mesh.positions) {
    lowest = std::min(lowest, (upright * glm::dvec4(p, 1.0)).y);
  }
  // It stands on the pedestal.
  scene.add_mesh(mesh, gold, translated(foot + dvec3(0.0, 0.779 - lowest, 0.0)) * upright);
}

void add_spheres(SceneBuilder& scene) {
  struct Ball {
    const char* name;
    Material material;
  };
  const std::array<Ball, 5> balls = {{
      {"copper smooth", metal({0.96f, 0.55f, 0.40f}, 0.12f)},
      {"copper rough", metal({0.96f, 0.55f, 0.40f}, 0.5f)},
      {"coral", dielectric({0.82f, 0.17f, 0.11f}, 0.3f)},
      {"teal gloss", dielectric({0.02f, 0.27f, 0.29f}, 0.12f)},
      {"teal matte", dielectric({0.03f, 0.33f, 0.35f}, 0.85f)},
  }};
  const Mesh sphere = make_sphere(0.31, 64, 40);
  for (int i = 0; i < 5; ++i) {
    // An arc about the pedestal, open towards the camera.
    const auto [s, c] = sin_cos_turns((i - 2) * 0.062);
    const auto material = scene.add_material(balls[i].name, balls[i].material);
    scene.add_object(balls[i].name);
    scene.add_mesh(sphere, material, translated(dvec3(2.25 * s, 0.31, 2.25 * c - 0.75)));
  }
}

void add_plant(SceneBuilder& scene) {
  const auto clay = scene.add_material("clay", dielectric({0.72f, 0.30f, 0.18f}, 0.8f));
  const auto soil = scene.add_material("soil", dielectric({0.06f, 0.04f, 0.03f}, 1.0f));
  Material leaf = dielectric(Vec3(1.0f), 0.6f);
  leaf.base_color_texture.texture =
      scene.add_texture(256, 256, leaf_texels(256), kernels::Wrap::clamp);
  leaf.alpha_mode = kernels::AlphaMode::mask;
  leaf.double_sided = 1;
  const auto green = scene.add_material("leaf", leaf);

  const dvec3 foot(-2.2, 0.0, -0.95);
  scene.add_object("pot");
  const std::array<dvec2, 8> profile = {dvec2(0.0, 0.0),   dvec2(0.30, 0.0),  dvec2(0.44, 0.5),
                                        dvec2(0.49, 0.5),  dvec2(0.51, 0.64), dvec2(0.45, 0.64),
                                        dvec2(0.43, 0.56), dvec2(0.42, 0.5)};
  scene.add_mesh(make_lathe(profile, 64), clay, translated(foot));
  const std::array<dvec2, 2> earth = {dvec2(0.435, 0.57), dvec2(0.0, 0.57)};
  scene.add_mesh(make_lathe(earth, 64), soil, translated(foot));

  scene.add_object("foliage");
  const int leaves = 26;
  for (int i = 0; i < leaves; ++i) {
    // Inner leaves stand up, outer ones hang; successive ones are a golden angle apart.
    const double outer = static_cast<double>(i) / (leaves - 1);
    const double height = 1.15 + 0.35 * uniform(2, i) - 0.25 * outer;
    const Mesh card = make_card(0.42, height, -(0.06 + 0.22 * outer), 10);
    const dmat4 place = translated(foot + dvec3(0.0, 0.56, 0.0)) *
                        turned(kUp, 0.381966 * i + 0.03 * uniform(3, i)) *
                        turned({1, 0, 0}, 0.02 + 0.07 * outer) * translated({0.0, 0.0, 0.05});
    scene.add_mesh(card, green, place);
  }
}

void add_pane(SceneBuilder& scene) {
  Material glass = dielectric({0.10f, 0.50f, 0.55f}, 0.06f);
  glass.base_color.a = 0.38f;
  glass.alpha_mode = kernels::AlphaMode::blend;
  glass.double_sided = 1;
  const auto pane = scene.add_material("glass", glass);
  const auto frame = scene.add_material("frame", metal({0.93f, 0.68f, 0.36f}, 0.3f));
  const auto white = scene.add_material("facets", dielectric({0.90f, 0.88f, 0.85f}, 0.5f));

  const dmat4 place = translated({1.85, 0.0, -0.55}) * turned(kUp, -0.06);
  scene.add_object("pane");
  scene.add_mesh(make_card(1.1, 1.5, 0.0, 1), pane, place * translated({0.0, 0.1, 0.0}));
  scene.add_object("frame");
  const Mesh post = make_rounded_box({0.035, 0.825, 0.035}, 0.012, 3);
  const Mesh rail = make_rounded_box({0.55, 0.035, 0.035}, 0.012, 3);
  for (const double side : {-1.0, 1.0}) {
    scene.add_mesh(post, frame, place * translated({side * 0.585, 0.825, 0.0}));
    scene.add_mesh(rail, frame, place * translated({0.0, 0.85 + side * 0.765, 0.0}));
  }
  scene.add_object("facets");
  scene.add_mesh(make_facets(0.5, 1), white,
                 translated({2.2, 0.475, -1.6}) * turned({1, 0, 0}, 0.04) * turned(kUp, 0.03));
}

void add_lamp(SceneBuilder& scene) {
  Material glow = dielectric({0.25f, 0.2f, 0.12f}, 0.9f);
  glow.emissive = Vec3(1.0f, 0.68f, 0.30f) * 1.25f;
  const auto globe = scene.add_material("glow", glow);
  const auto brass = scene.add_material("brass", metal({0.88f, 0.64f, 0.34f}, 0.35f));
  const dvec3 foot(-1.15, 0.0, 0.1);
  scene.add_object("lamp");
  const std::array<dvec2, 7> stand = {dvec2(0.0, 0.0),   dvec2(0.2, 0.0),    dvec2(0.2, 0.025),
                                      dvec2(0.03, 0.05), dvec2(0.022, 0.08), dvec2(0.022, 0.62),
                                      dvec2(0.09, 0.66)};
  scene.add_mesh(make_lathe(stand, 48), brass, translated(foot));
  scene.add_object("globe");
  scene.add_mesh(make_sphere(0.19, 48, 32), globe, translated(foot + dvec3(0.0, 0.82, 0.0)));
}

void add_blocks_and_backdrop(SceneBuilder& scene) {
  const auto navy = scene.add_material("navy", dielectric({0.05f, 0.09f, 0.22f}, 0.4f));
  const auto cream = scene.add_material("cream", dielectric({0.90f, 0.78f, 0.58f}, 0.6f));
  scene.add_object("block");
  scene.add_mesh(make_rounded_box(dvec3(0.36), 0.06, 6), navy,
                 translated({1.25, 0.36, 0.42}) * turned(kUp, 0.07));
  scene.add_object("small block");
  scene.add_mesh(make_rounded_box(dvec3(0.2), 0.04, 6), cream,
                 translated({1.22, 0.92, 0.4}) * turned(kUp, 0.2));

  Material sun;
  sun.base_color = {0.90f, 0.24f, 0.13f, 1.0f};
  sun.unlit = 1;
  const auto unlit = scene.add_material("sun", sun);
  scene.add_object("backdrop");
  const std::array<dvec2, 3> disc = {dvec2(1.75, -0.05), dvec2(1.75, 0.0), dvec2(0.0, 0.0)};
  scene.add_mesh(make_lathe(disc, 128), unlit,
                 translated({0.0, 1.75, -2.3}) * turned({1, 0, 0}, 0.25));
}

Vec3 direction(const dvec3& from, const dvec3& to) {
  const dvec3 d = to - from;
  return Vec3(d / std::sqrt(glm::dot(d, d)));
}

void add_lights(Scene& scene) {
  kernels::Light sun{};
  sun.type = kernels::LightType::directional;
  sun.direction = direction({-3.0, 5.0, 4.0}, {0.0, 0.0, 0.0});
  sun.intensity = {2.6f, 2.35f, 2.0f};
  sun.range = std::numeric_limits<float>::infinity();

  kernels::Light lamp{};
  lamp.type = kernels::LightType::point;
  lamp.position = {-1.15f, 1.12f, 0.1f};  // above the globe, which would shade what is inside
  lamp.intensity = {2.4f, 1.6f, 0.8f};
  lamp.range = std::numeric_limits<float>::infinity();

  kernels::Light spot{};
  spot.type = kernels::LightType::spot;
  const dvec3 place(3.2, 4.2, 2.6);
  spot.position = Vec3(place);
  spot.direction = direction(place, {0.2, 0.9, -0.5});
  spot.intensity = {26.0f, 28.0f, 34.0f};
  spot.range = std::numeric_limits<float>::infinity();
  const double inner = sin_cos_turns(0.04).cos, outer = sin_cos_turns(0.075).cos;
  spot.spot_scale = static_cast<float>(1.0 / (inner - outer));
  spot.spot_offset = static_cast<float>(-outer / (inner - outer));
  scene.lights = {sun, lamp, spot};
}

}  // namespace

Scene make_default_scene() {
  SceneBuilder builder;
  add_stage(builder);
  add_knot(builder);
  add_spheres(builder);
  add_plant(builder);
  add_pane(builder);
  add_lamp(builder);
  add_blocks_and_backdrop(builder);
  add_lights(builder.scene());
  Camera camera = look_at({1.5, 3.3, 9.9}, {0.0, 0.93, -0.35}, 0.5);
  camera.name = "main";
  camera.znear = 0.1;
  builder.scene().cameras.push_back(camera);
  return std::move(builder).finish();
}

}  // namespace octrace::scene
