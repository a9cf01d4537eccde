#include "tests/unit/exporters_scene.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <stdexcept>

namespace octrace::test {

using kernels::kNone;
using kernels::Vec2;
using kernels::Vec3;

void add_part(scene::Scene& scene, const Part& part) {
  kernels::Geometry geometry{};
  geometry.first_triangle = static_cast<std::uint32_t>(scene.triangles.size());
  geometry.triangle_count = static_cast<std::uint32_t>(part.triangles.size());
  geometry.first_vertex = static_cast<std::uint32_t>(scene.positions.size());
  geometry.vertex_count = static_cast<std::uint32_t>(part.positions.size());
  geometry.object = static_cast<std::uint32_t>(scene.object_names.size());
  geometry.material = part.material;
  const auto append = [](auto& all, const auto& own) {
    if (own.empty()) return kNone;
    const auto first = static_cast<std::uint32_t>(all.size());
    all.insert(all.end(), own.begin(), own.end());
    return first;
  };
  geometry.normals = append(scene.normals, part.normals);
  geometry.uv0 = append(scene.uvs, part.uvs);
  geometry.colors = append(scene.colors, part.colors);
  geometry.tangents = geometry.uv1 = kNone;
  for (const kernels::Triangle& t : part.triangles) {
    const std::uint32_t base = geometry.first_vertex;
    scene.triangles.push_back({t.a + base, t.b + base, t.c + base});
    scene.triangle_geometry.push_back(static_cast<std::uint32_t>(scene.geometries.size()));
  }
  scene.positions.insert(scene.positions.end(), part.positions.begin(), part.positions.end());
  scene.geometries.push_back(geometry);
  scene.object_names.push_back(part.name);
}

std::uint32_t add_material(scene::Scene& scene, const kernels::Material& material,
                           const std::string& name) {
  scene.materials.push_back(material);
  scene.material_names.push_back(name);
  return static_cast<std::uint32_t>(scene.materials.size()) - 1;
}

std::uint32_t add_texture(scene::Scene& scene, std::uint32_t width, std::uint32_t height,
                          const std::vector<std::uint32_t>& texels, kernels::Wrap wrap_s,
                          kernels::Wrap wrap_t, kernels::Filter filter) {
  scene.textures.push_back({scene.texels.size(), width, height, wrap_s, wrap_t, filter, 1});
  scene.texels.insert(scene.texels.end(), texels.begin(), texels.end());
  return static_cast<std::uint32_t>(scene.textures.size()) - 1;
}

void finish(scene::Scene& scene) {
  scene.bounds = {};
  if (scene.positions.empty()) return;
  scene.bounds.empty = false;
  scene.bounds.lower = scene.bounds.upper = scene.positions.front();
  for (const Vec3& p : scene.positions) {
    scene.bounds.lower = glm::min(scene.bounds.lower, p);
    scene.bounds.upper = glm::max(scene.bounds.upper, p);
  }
}

Part sphere(const std::string& name, const Vec3& centre, float radius, int around, int rings) {
  Part part{name, 0, {}, {}};
  const double pi = 3.14159265358979323846;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int i = 0; i <= around; ++i) {
      const double polar = pi * ring / rings, turn = 2.0 * pi * (i % around) / around;
      const Vec3 normal(std::sin(polar) * std::sin(turn), std::cos(polar),
                        std::sin(polar) * std::cos(turn));
      part.positions.push_back(centre + radius * normal);
      part.normals.push_back(normal);
      part.uvs.push_back({static_cast<float>(i) / around, static_cast<float>(ring) / rings});
    }
  }
  for (int ring = 0; ring < rings; ++ring) {
    for (int i = 0; i < around; ++i) {
      const auto a = static_cast<std::uint32_t>(ring * (around + 1) + i);
      const std::uint32_t b = a + static_cast<std::uint32_t>(around) + 1;
      part.triangles.push_back({a, b, b + 1});
      part.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return part;
}

Part box(const std::string& name, const Vec3& centre, const Vec3& half) {
  Part part{name, 0, {}, {}};
  for (int i = 0; i < 8; ++i) {
    part.positions.push_back(
        centre + half * Vec3(i & 1 ? 1.0f : -1.0f, i & 2 ? 1.0f : -1.0f, i & 4 ? 1.0f : -1.0f));
  }
  part.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return part;
}

Part card(const std::string& name, const Vec3& centre, float half_x, float half_y, float uv_scale) {
  Part part{name, 0, {}, {{0, 1, 2}, {0, 2, 3}}};
  for (const Vec2& corner : {Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1), Vec2(-1, 1)}) {
    part.positions.push_back(centre + Vec3(half_x * corner.x, half_y * corner.y, 0.0f));
    part.uvs.push_back(uv_scale * Vec2(0.5f + 0.5f * corner.x, 0.5f - 0.5f * corner.y));
    part.normals.push_back({0, 0, 1});
  }
  return part;
}

void flip(Part& part) {
  for (auto& triangle : part.triangles) std::swap(triangle.b, triangle.c);
  for (auto& normal : part.normals) normal = -normal;
}

scene::Camera look_at(const glm::dvec3& eye, const glm::dvec3& target, double yfov) {
  scene::Camera camera;
  camera.yfov = yfov;
  const glm::dvec3 back = glm::normalize(eye - target);
  const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0, 1, 0), back));
  camera.matrix = {{right, 0}, {glm::cross(back, right), 0}, {back, 0}, {eye, 1}};
  return camera;
}

scene::Scene varied_scene() {
  scene::Scene scene;
  kernels::Material single, both, cut, faded;
  both.double_sided = 1;
  cut.alpha_mode = kernels::AlphaMode::mask;
  cut.alpha_cutoff = 0.45f;
  cut.base_color.w = 0.9f;
  faded.alpha_mode = kernels::AlphaMode::blend;
  faded.base_color.w = 0.3f;
  faded.double_sided = 1;
  // Alphas in no order, so that a texel in the wrong place shows.
  std::vector<std::uint32_t> texels;
  for (std::uint32_t i = 0; i < 8 * 6; ++i)
    texels.push_back(0xffffffu | (i * 97u + 31u) % 256u << 24);
  kernels::Material cuts[3] = {cut, cut, cut};
  const kernels::Wrap wraps[3][2] = {{kernels::Wrap::repeat, kernels::Wrap::mirror},
                                     {kernels::Wrap::clamp, kernels::Wrap::repeat},
                                     {kernels::Wrap::mirror, kernels::Wrap::clamp}};
  add_material(scene, single, "single");
  add_material(scene, both, "both");
  add_material(scene, faded, "faded");
  for (int i = 0; i < 3; ++i) {
    cuts[i].base_color_texture.texture =
        add_texture(scene, 8, 6, texels, wraps[i][0], wraps[i][1],
                    i == 1 ? kernels::Filter::nearest : kernels::Filter::linear);
    cuts[i].base_color_texture.transform_u = {0.8f, 0.3f, -0.2f};
    cuts[i].base_color_texture.transform_v = {-0.3f, 0.8f, -0.4f};
    cuts[i].double_sided = i == 2 ? 1 : 0;
    add_material(scene, cuts[i], "cut");
  }

  add_part(scene, sphere("ball", {-2.0f, 0.5f, 0.0f}, 1.1f));
  add_part(scene, box("crate", {1.7f, -0.4f, -0.5f}, {0.8f, 0.9f, 0.7f}));
  // Seen from inside: only its far wall shows.
  Part room = box("room", {0.0f, 0.0f, -1.0f}, {5.0f, 3.0f, 6.0f});
  flip(room);
  add_part(scene, room);
  Part away = card("away", {0.0f, 2.0f, 0.5f}, 0.7f, 0.5f);
  flip(away);
  add_part(scene, away);
  Part open = away;
  open.name = "open";
  open.material = 1;
  for (Vec3& p : open.positions) p.x += 2.0f;
  add_part(scene, open);
  // Two sheets in one place that look both ways: the front one must not hide behind the back one.
  Part front = card("front", {-3.2f, -1.2f, 1.0f}, 0.6f, 0.5f);
  Part back = front;
  back.name = "back";
  flip(back);
  add_part(scene, back);
  add_part(scene, front);
  Part glass = card("glass", {0.2f, 0.4f, 1.2f}, 0.5f, 0.9f);
  glass.material = 2;
  add_part(scene, glass);
  for (std::uint32_t i = 0; i < 3; ++i) {
    Part leaf = card("leaf", {-0.9f + 1.5f * i, -1.4f, 1.5f}, 0.7f, 0.7f, 3.0f);
    leaf.material = 3 + i;
    add_part(scene, leaf);
  }
  Part fading = card("fading", {3.1f, 0.9f, 1.2f}, 0.5f, 0.9f);
  fading.uvs.clear();
  fading.material = add_material(scene, cut, "vertex alpha");
  fading.colors = {{1, 1, 1, 0}, {1, 1, 1, 1}, {1, 1, 1, 0.7f}, {1, 1, 1, 0.2f}};
  add_part(scene, fading);
  add_part(scene, {"degenerate",
                   1,
                   {{0, 0, 2}, {1, 1, 2}, {2, 2, 2}, {0, 0, 2}},
                   {{0, 1, 2}, {0, 0, 0}, {0, 3, 1}}});
  finish(scene);
  return scene;
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "octrace-exporters-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace octrace::test
