#include "tests/unit/render_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

namespace octrace::test {

using kernels::kNone;

MeshData make_quad(Vec3 centre, float half) {
  MeshData mesh;
  mesh.positions = {centre + Vec3(-half, -half, 0), centre + Vec3(half, -half, 0),
                    centre + Vec3(half, half, 0), centre + Vec3(-half, half, 0)};
  mesh.uvs = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

MeshData make_ball(Vec3 centre, float radius, int around, int rings, bool smooth) {
  MeshData mesh;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int i = 0; i <= around; ++i) {
      const double theta = std::numbers::pi * ring / rings;
      const double phi = 2.0 * std::numbers::pi * i / around;
      const Vec3 n(static_cast<float>(std::sin(theta) * std::sin(phi)),
                   static_cast<float>(std::cos(theta)),
                   static_cast<float>(std::sin(theta) * std::cos(phi)));
      mesh.positions.push_back(centre + radius * n);
      if (smooth) mesh.normals.push_back(n);
      mesh.uvs.push_back({static_cast<float>(i) / around, static_cast<float>(ring) / rings});
    }
  }
  for (int ring = 0; ring < rings; ++ring) {
    for (int i = 0; i < around; ++i) {
      const auto a = static_cast<std::uint32_t>(ring * (around + 1) + i);
      const auto b = a + static_cast<std::uint32_t>(around) + 1;
      if (ring + 1 < rings) mesh.triangles.push_back({a, b, b + 1});
      if (ring > 0) mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

scene::Scene empty_scene() {
  scene::Scene scene;
  add_material(scene, kernels::Material{});
  return scene;
}

std::uint32_t add_material(scene::Scene& scene, const kernels::Material& material) {
  scene.materials.push_back(material);
  scene.material_names.push_back("material");
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

template <class T>
std::uint32_t append(std::vector<T>& to, const std::vector<T>& from) {
  if (from.empty()) return kNone;
  const auto first = static_cast<std::uint32_t>(to.size());
  to.insert(to.end(), from.begin(), from.end());
  return first;
}

std::uint32_t add_mesh(scene::Scene& scene, const MeshData& mesh, std::uint32_t material) {
  kernels::Geometry geometry{};
  geometry.first_triangle = static_cast<std::uint32_t>(scene.triangles.size());
  geometry.triangle_count = static_cast<std::uint32_t>(mesh.triangles.size());
  geometry.first_vertex = static_cast<std::uint32_t>(scene.positions.size());
  geometry.vertex_count = static_cast<std::uint32_t>(mesh.positions.size());
  geometry.object = static_cast<std::uint32_t>(scene.object_names.size());
  geometry.material = material;
  geometry.normals = append(scene.normals, mesh.normals);
  geometry.tangents = kNone;
  geometry.uv0 = append(scene.uvs, mesh.uvs);
  geometry.uv1 = kNone;
  geometry.colors = append(scene.colors, mesh.colors);
  const auto index = static_cast<std::uint32_t>(scene.geometries.size());
  for (const kernels::Triangle& t : mesh.triangles) {
    const std::uint32_t base = geometry.first_vertex;
    scene.triangles.push_back({t.a + base, t.b + base, t.c + base});
    scene.triangle_geometry.push_back(index);
  }
  for (const Vec3& p : mesh.positions) {
    scene::Bounds& bounds = scene.bounds;
    bounds.lower = bounds.empty ? p : glm::min(bounds.lower, p);
    bounds.upper = bounds.empty ? p : glm::max(bounds.upper, p);
    bounds.empty = false;
    scene.positions.push_back(p);
  }
  scene.geometries.push_back(geometry);
  scene.object_names.push_back("object");
  return index;
}

kernels::Material matte(Vec3 color, float roughness) {
  kernels::Material material;
  material.base_color = Vec4(color, 1.0f);
  material.metallic = 0.0f;
  material.roughness = roughness;
  return material;
}

std::uint32_t add_texture(scene::Scene& scene, std::uint32_t width, std::uint32_t height,
                          const std::vector<std::uint32_t>& texels, kernels::Wrap wrap,
                          kernels::Filter filter, bool srgb) {
  kernels::Texture texture{};
  texture.first_texel = scene.texels.size();
  texture.width = width;
  texture.height = height;
  texture.wrap_s = texture.wrap_t = wrap;
  texture.filter = filter;
  texture.srgb = srgb ? 1 : 0;
  scene.texels.insert(scene.texels.end(), texels.begin(), texels.end());
  scene.textures.push_back(texture);
  return static_cast<std::uint32_t>(scene.textures.size() - 1);
}

void add_darkness(scene::Scene& scene) {
  kernels::Light light{};
  light.type = kernels::LightType::directional;
  light.direction = Vec3(0, -1, 0);
  light.range = std::numeric_limits<float>::infinity();
  scene.lights.push_back(light);
}

scene::Camera camera_at(Vec3 eye, double yfov) {
  scene::Camera camera;
  camera.yfov = yfov;
  camera.matrix = glm::translate(glm::dmat4(1.0), glm::dvec3(eye));
  return camera;
}

scene::Camera orthographic_at(Vec3 eye, double half_height) {
  scene::Camera camera = camera_at(eye, 1.0);
  camera.type = scene::CameraType::orthographic;
  camera.xmag = camera.ymag = half_height;
  return camera;
}

namespace {
std::size_t at(const render::Framebuffer& framebuffer, int x, int y) {
  return static_cast<std::size_t>(y) * framebuffer.width() + static_cast<std::size_t>(x);
}
}  // namespace

Vec3 Rendered::vec3(render::Aov aov, int x, int y) const {
  const float* p = &framebuffer.floats(aov)[3 * at(framebuffer, x, y)];
  return {p[0], p[1], p[2]};
}
Vec4 Rendered::rgba(int x, int y) const {
  const float* p = &framebuffer.floats(render::Aov::beauty)[4 * at(framebuffer, x, y)];
  return {p[0], p[1], p[2], p[3]};
}
float Rendered::value(render::Aov aov, int x, int y) const {
  return framebuffer.floats(aov)[at(framebuffer, x, y)];
}
std::uint32_t Rendered::id(render::Aov aov, int x, int y) const {
  return framebuffer.uints(aov)[at(framebuffer, x, y)];
}

Rendered render_scene(const scene::Scene& scene, const scene::Camera& camera, int width, int height,
                      const render::Settings& settings, std::string_view aovs) {
  const auto octree = octree::build(scene, {});
  EXPECT_TRUE(octree) << octree.error().to_string();
  const auto set = render::parse_aovs(aovs);
  EXPECT_TRUE(set) << set.error().to_string();
  Rendered rendered{render::Framebuffer(static_cast<std::uint32_t>(width),
                                        static_cast<std::uint32_t>(height), *set),
                    {}};
  const auto renderer = render::make_cpu_renderer(scene, *octree);
  const auto stats = renderer->render(scene::make_ray_camera(camera, width, height), settings,
                                      rendered.framebuffer);
  EXPECT_TRUE(stats) << stats.error().to_string();
  if (stats) rendered.stats = *stats;
  return rendered;
}

}  // namespace octrace::test
