// What lights a surface: punctual lights and a sky of constant radiance, as connections that the
// caller tests for occlusion.
#pragma once

#include "kernels/brdf.h"
#include "kernels/light.h"
#include "kernels/ray.h"
#include "kernels/render_params.h"
#include "kernels/sample.h"
#include "kernels/surface.h"

namespace octrace::kernels {

// More lights than this are sampled, stratified over their list, instead of all followed.
inline constexpr std::uint32_t kMaxLightsFollowed = 16;

// Random dimensions of one shaded surface; the next one starts kDimensions further.
inline constexpr std::uint32_t kDiffuseDimension = 0;
inline constexpr std::uint32_t kSpecularDimension = 1;
inline constexpr std::uint32_t kLightDimension = 2;
inline constexpr std::uint32_t kDimensions = 3;

// A surface ready to be lit from any direction.
struct ShadingPoint {
  Surface surface;
  Vec3 origin;  // of shadow and sky rays
  Vec3 view;    // unit, to the viewer
  Vec3 normal;  // shading normal, bent so that the viewer is above its horizon
  Brdf brdf;
  float occlusion;  // of sky light, by the occlusion texture; 1: none
  Vec3 emission;
};

// Normals may point away from the viewer at silhouettes and under strong normal textures, where the
// BRDF would be zero and the pixel black: bend them just above the horizon.
OCTRACE_HD inline Vec3 visible_normal(Vec3 normal, Vec3 view) {
  constexpr float kLowest = 1e-2f;
  const float cosine = dot(normal, view);
  if (cosine >= kLowest) return normal;
  return normalize_or(normal + (kLowest - cosine) * view, view);
}

template <class AnySurface>
OCTRACE_HD inline ShadingPoint make_shading_point(const SceneView& scene, const AnySurface& surface,
                                                  Vec3 view, const Vec4& color) {
  const Geometry& geometry = geometry_of(scene, surface);
  const Material& material = material_of(scene, surface);
  const Vec4 mr =
      sample_texture(scene, geometry, surface.point, material.metallic_roughness_texture);
  const Vec4 emissive = sample_texture(scene, geometry, surface.point, material.emissive_texture);
  const float occlusion =
      sample_texture(scene, geometry, surface.point, material.occlusion_texture).x;
  ShadingPoint result;
  result.surface = surface;
  result.origin = ray_origin(scene, surface);
  result.view = view;
  result.normal = visible_normal(shading_normal(scene, surface), view);
  result.brdf = make_brdf(Vec3(color.x, color.y, color.z), material.metallic * mr.z,
                          material.roughness * mr.y);
  result.occlusion = 1.0f + material.occlusion_strength * (occlusion - 1.0f);
  result.emission = material.emissive * Vec3(emissive.x, emissive.y, emissive.z);
  return result;
}

// A normal texture may face a light that the smooth surface turns away from. The cut is softened
// (Chiang, Li and Burley 2019, "Taming the shadow terminator") so that it shows no edge.
OCTRACE_HD inline float terminator(const ShadingPoint& at, Vec3 to_light) {
  const float smooth = dot(at.surface.vertex_normal, to_light);
  if (!(smooth > 0.0f)) return 0.0f;
  const float shading = dot(at.normal, to_light) * dot(at.normal, at.surface.vertex_normal);
  if (!(shading > smooth)) return 1.0f;
  const float g = smooth / shading;
  return ((-g + 1.0f) * g + 1.0f) * g;
}

// One way in which light reaches a shading point: how much comes along the ray if nothing blocks
// it.
struct Connection {
  Ray ray;
  Vec3 radiance;
};

OCTRACE_HD inline Connection sky_connection(const RenderParams& params, const ShadingPoint& at,
                                            const BrdfSample& sample) {
  const float weight = terminator(at, sample.direction) * at.occlusion;
  return {{at.origin, 0.0f, sample.direction, std::numeric_limits<float>::infinity()},
          weight * (params.sky * sample.weight)};
}

OCTRACE_HD inline BrdfSample sample_diffuse(const ShadingPoint& at, const Sampler& sampler,
                                            std::uint32_t dimension) {
  return sample_diffuse(at.brdf, make_basis(at.normal), at.view,
                        sampler.get2(dimension + kDiffuseDimension));
}

OCTRACE_HD inline BrdfSample sample_specular(const ShadingPoint& at, const Sampler& sampler,
                                             std::uint32_t dimension) {
  return sample_specular(at.brdf, make_basis(at.normal), at.view,
                         sampler.get2(dimension + kSpecularDimension));
}

OCTRACE_HD inline Connection light_connection(const ShadingPoint& at, const Light& light) {
  const Illumination from = illuminate(light, at.origin);
  return {{at.origin, 0.0f, from.to_light, from.end},
          terminator(at, from.direction) * from.irradiance *
              evaluate_brdf(at.brdf, at.normal, at.view, from.direction)};
}

OCTRACE_HD inline std::uint32_t lights_followed(const SceneView& scene) {
  const std::uint32_t count = light_count(scene);
  return count < kMaxLightsFollowed ? count : kMaxLightsFollowed;
}

// The i-th of lights_followed(): each light is picked with the same density.
OCTRACE_HD inline Connection light_connection(const SceneView& scene, const ShadingPoint& at,
                                              const Sampler& sampler, std::uint32_t dimension,
                                              std::uint32_t i) {
  const std::uint32_t count = light_count(scene), followed = lights_followed(scene);
  if (count == followed) return light_connection(at, light_at(scene, i));
  const float weight = static_cast<float>(count) / static_cast<float>(followed);
  const float shift = sampler.get1(dimension + kLightDimension);
  const auto pick = static_cast<std::uint32_t>((static_cast<float>(i) + shift) * weight);
  Connection connection = light_connection(at, light_at(scene, pick < count ? pick : count - 1));
  connection.radiance *= weight;
  return connection;
}

}  // namespace octrace::kernels
