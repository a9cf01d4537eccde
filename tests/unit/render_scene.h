// Small scenes and one-call renders for the renderer's tests.
#pragma once

#include <vector>

#include "backend/octree/octree.h"
#include "backend/render/renderer.h"
#include "backend/scene/scene.h"

namespace octrace::test {

using kernels::Vec2;
using kernels::Vec3;
using kernels::Vec4;

struct MeshData {
  std::vector<Vec3> positions;
  std::vector<kernels::Triangle> triangles;  // indices into positions
  std::vector<Vec3> normals;                 // none: flat
  std::vector<Vec2> uvs;
  std::vector<Vec4> colors;
};

// A square of the given half size about `centre`, its front towards +z, uv (0, 0) at the top left.
MeshData make_quad(Vec3 centre, float half);
// Vertices on the sphere; normals exact. Front outside.
MeshData make_ball(Vec3 centre, float radius, int around, int rings, bool smooth);

scene::Scene empty_scene();  // one default material, no lights
// Adds a geometry of its own object; returns its index.
std::uint32_t add_mesh(scene::Scene& scene, const MeshData& mesh, std::uint32_t material);
std::uint32_t add_material(scene::Scene& scene, const kernels::Material& material);
// Opaque dielectric without texture.
kernels::Material matte(Vec3 color, float roughness = 1.0f);
// RGBA texels; returns the texture's index.
std::uint32_t add_texture(scene::Scene& scene, std::uint32_t width, std::uint32_t height,
                          const std::vector<std::uint32_t>& texels, kernels::Wrap wrap,
                          kernels::Filter filter, bool srgb);
// A light that does nothing: without it the default light shines.
void add_darkness(scene::Scene& scene);

// Looks along -z from `eye`.
scene::Camera camera_at(Vec3 eye, double yfov);
scene::Camera orthographic_at(Vec3 eye, double half_height);

struct Rendered {
  render::Framebuffer framebuffer;
  render::TraceStats stats;

  Vec3 vec3(render::Aov aov, int x, int y) const;
  Vec4 rgba(int x, int y) const;
  float value(render::Aov aov, int x, int y) const;
  std::uint32_t id(render::Aov aov, int x, int y) const;
};

// Fails the test where the render fails.
Rendered render_scene(const scene::Scene& scene, const scene::Camera& camera, int width, int height,
                      const render::Settings& settings = {}, std::string_view aovs = "all");

}  // namespace octrace::test
