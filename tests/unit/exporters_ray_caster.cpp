#include "tests/unit/exporters_ray_caster.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>

namespace octrace::test {

namespace {

using glm::dvec2;
using glm::dvec3;
using kernels::kNone;

struct CastRay {
  dvec3 origin, direction;  // the parameter is planar depth
};

CastRay pixel_ray(const scene::Camera& camera, const CastOptions& options, int column, int row) {
  const double px = column + 0.5, py = row + 0.5, w = options.width, h = options.height;
  dvec3 local(0.0), shift(0.0);
  switch (camera.type) {
    case scene::CameraType::perspective: {
      const double half = std::tan(camera.yfov / 2.0);
      local = {(2.0 * px / w - 1.0) * half * w / h, (1.0 - 2.0 * py / h) * half, -1.0};
      break;
    }
    case scene::CameraType::orthographic:
      local = {0, 0, -1};
      // Of xmag only the sign counts.
      shift = {(2.0 * px / w - 1.0) * std::copysign(camera.ymag, camera.xmag) * w / h,
               (1.0 - 2.0 * py / h) * camera.ymag, 0};
      break;
    case scene::CameraType::pinhole: {
      const double fit_x = camera.width > 0 ? camera.width / w : 1.0;
      const double fit_y = camera.height > 0 ? camera.height / h : 1.0;
      local = {(px * fit_x - camera.cx) / camera.fx, -(py * fit_y - camera.cy) / camera.fy, -1.0};
      break;
    }
  }
  // Test cameras have orthogonal axes; scale is what a renderer removes.
  const dvec3 x = glm::normalize(dvec3(camera.matrix[0]));
  const dvec3 y = glm::normalize(dvec3(camera.matrix[1]));
  const dvec3 z = glm::normalize(dvec3(camera.matrix[2]));
  return {dvec3(camera.matrix[3]) + shift.x * x + shift.y * y,
          local.x * x + local.y * y + local.z * z};
}

std::int64_t wrap(std::int64_t i, std::int64_t n, kernels::Wrap mode) {
  if (mode == kernels::Wrap::clamp) return i < 0 ? 0 : i >= n ? n - 1 : i;
  const std::int64_t period = mode == kernels::Wrap::mirror ? 2 * n : n;
  const std::int64_t m = ((i % period) + period) % period;
  return m < n ? m : 2 * n - 1 - m;
}

double texture_alpha(const scene::Scene& scene, const kernels::Texture& texture, const dvec2& uv) {
  const auto texel = [&](double column, double row) {
    const std::int64_t x = wrap(static_cast<std::int64_t>(column), texture.width, texture.wrap_s);
    const std::int64_t y = wrap(static_cast<std::int64_t>(row), texture.height, texture.wrap_t);
    return (scene.texels[texture.first_texel + static_cast<std::uint64_t>(y) * texture.width +
                         static_cast<std::uint64_t>(x)] >>
            24) /
           255.0;
  };
  const double x = uv.x * texture.width, y = uv.y * texture.height;
  if (texture.filter == kernels::Filter::nearest) return texel(std::floor(x), std::floor(y));
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5);
  const double fx = x - 0.5 - left, fy = y - 0.5 - top;
  return (texel(left, top) * (1 - fx) + texel(left + 1, top) * fx) * (1 - fy) +
         (texel(left, top + 1) * (1 - fx) + texel(left + 1, top + 1) * fx) * fy;
}

double alpha_at(const scene::Scene& scene, const kernels::Geometry& geometry,
                const kernels::Triangle& triangle, const dvec3& weights) {
  const kernels::Material& material = scene.materials[geometry.material];
  const std::uint32_t corners[3] = {triangle.a, triangle.b, triangle.c};
  double alpha = material.base_color.w, vertex_alpha = 0.0;
  dvec2 uv(0.0);
  const kernels::TextureRef& ref = material.base_color_texture;
  const std::uint32_t set = ref.texcoord == 0 ? geometry.uv0 : geometry.uv1;
  for (int i = 0; i < 3; ++i) {
    const std::size_t entry = corners[i] - geometry.first_vertex;
    if (set != kNone) uv += weights[i] * dvec2(scene.uvs[set + entry]);
    if (geometry.colors != kNone)
      vertex_alpha += weights[i] * scene.colors[geometry.colors + entry].w;
  }
  if (geometry.colors != kNone) alpha *= vertex_alpha;
  if (ref.texture != kNone) {
    const dvec3 p(uv, 1.0);
    alpha *=
        texture_alpha(scene, scene.textures[ref.texture],
                      {glm::dot(dvec3(ref.transform_u), p), glm::dot(dvec3(ref.transform_v), p)});
  }
  return alpha;
}

// Barycentric weights by signed volumes; false: no hit.
bool hit_triangle(const CastRay& ray, const dvec3 (&corner)[3], double* t, dvec3* weights,
                  bool* front) {
  const dvec3 normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double along = glm::dot(normal, ray.direction);
  if (along == 0.0) return false;
  *t = glm::dot(normal, corner[0] - ray.origin) / along;
  for (int i = 0; i < 3; ++i) {
    const dvec3 b = corner[(i + 1) % 3] - ray.origin, c = corner[(i + 2) % 3] - ray.origin;
    (*weights)[i] = glm::dot(ray.direction, glm::cross(b, c)) / -along;
  }
  const double sum = weights->x + weights->y + weights->z;
  if (sum == 0.0) return false;
  *weights /= sum;
  *front = along < 0.0;
  return weights->x >= 0.0 && weights->y >= 0.0 && weights->z >= 0.0;
}

Sight look_along(const scene::Scene& scene, const scene::Camera& camera, const CastOptions& options,
                 const CastRay& ray) {
  Sight sight;
  sight.depth = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < scene.triangles.size(); ++i) {
    const kernels::Triangle& triangle = scene.triangles[i];
    const kernels::Geometry& geometry = scene.geometries[scene.triangle_geometry[i]];
    const kernels::Material& material = scene.materials[geometry.material];
    const dvec3 corner[3] = {dvec3(scene.positions[triangle.a]), dvec3(scene.positions[triangle.b]),
                             dvec3(scene.positions[triangle.c])};
    double t = 0.0;
    dvec3 weights;
    bool front = false;
    if (!hit_triangle(ray, corner, &t, &weights, &front)) continue;
    if (t <= 0.0 || t < camera.znear || t > camera.zfar || t >= sight.depth) continue;
    if (options.cull && material.double_sided == 0 && !front) continue;
    if (options.alpha && material.alpha_mode == kernels::AlphaMode::mask &&
        alpha_at(scene, geometry, triangle, weights) < material.alpha_cutoff) {
      continue;
    }
    sight = {t, geometry.object + 1};
  }
  return sight;
}

}  // namespace

std::vector<Sight> cast_rays(const scene::Scene& scene, const scene::Camera& camera,
                             const CastOptions& options) {
  std::vector<Sight> image;
  for (int row = 0; row < options.height; ++row) {
    for (int column = 0; column < options.width; ++column) {
      image.push_back(look_along(scene, camera, options, pixel_ray(camera, options, column, row)));
    }
  }
  return image;
}

}  // namespace octrace::test
