// A surface's coverage at a hit: what cuts holes (alpha mode MASK) and what lets light through
// (BLEND).
#pragma once

#include "kernels/attributes.h"
#include "kernels/scene_view.h"

namespace octrace::kernels {

// Alpha of the base colour: factor * texture * vertex colour, in [0, 1].
OCTRACE_HD inline float surface_alpha(const SceneView& scene, std::uint32_t geometry_index,
                                      std::uint32_t triangle, float u, float v) {
  const Geometry& geometry = scene.geometries[geometry_index];
  const Material& material = scene.materials[geometry.material];
  const SurfacePoint point{scene.triangles[triangle], geometry_index, u, v};
  float alpha = material.base_color.w;
  if (material.base_color_texture.texture != kNone)
    alpha *= sample_texture(scene, geometry, point, material.base_color_texture).w;
  if (geometry.colors != kNone)
    alpha *= interpolate(scene.colors, geometry.colors, geometry, point).w;
  return clamp01(alpha);
}

// Alpha mode MASK: at or above the cutoff the surface is there, below it is not (glTF 2.0, 3.9.4).
OCTRACE_HD inline bool alpha_passes(const SceneView& scene, std::uint32_t geometry_index,
                                    std::uint32_t triangle, float u, float v) {
  const Material& material = scene.materials[scene.geometries[geometry_index].material];
  return surface_alpha(scene, geometry_index, triangle, u, v) >= material.alpha_cutoff;
}

}  // namespace octrace::kernels
