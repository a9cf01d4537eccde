// The colour that one camera ray sees. Light is direct, but for one step: a ray that the specular
// lobe sends towards the sky and that meets a surface returns that surface's own direct light, so
// that metals mirror their surroundings. Surfaces with alpha mode BLEND are composited front to
// back by letting the same ray go on behind them.
#pragma once

#include "kernels/intersect.h"
#include "kernels/shade.h"

namespace octrace::kernels {

struct RayCounts {
  std::uint64_t beauty = 0;  // camera, transparency, reflection and sky rays
  std::uint64_t shadow = 0;  // towards punctual lights
};

// The layer at which a ray through BLEND surfaces ends counts as opaque.
inline constexpr std::uint32_t kMaxLayers = 32;
// A ray that carries less than this share of the pixel ends.
inline constexpr float kLeastWeight = 1e-4f;
// Radiance above this is cut, so that sums stay finite whatever a scene's lights emit.
inline constexpr float kMaxRadiance = 1e30f;

// A surface seen in a rough reflection shows highlights no sharper than this multiple of the
// reflection's own lobe: the eye cannot tell, and a rough lobe would find sharp ones too seldom, as
// bright specks (Kaplanyan and Dachsbacher 2013, "Path space regularization").
inline constexpr float kReflectionBlur = 3.0f;

struct Segment {
  Ray ray;
  Vec3 weight;       // of what this ray sees, in the pixel
  float sky_weight;  // further factor for the sky: the occlusion texture where the ray left
  float blur;        // GGX alpha of the reflection that sent it; 0: straight from the camera
  bool reflected;
  std::uint32_t layer;
};

// The same ray, just behind a hit: by four to eight units in the last place of t, which leaves out
// the hit itself and, where the ray runs through an edge, the triangle on the edge's other side.
OCTRACE_HD inline Segment behind(const Segment& segment, float t, float alpha) {
  Segment next = segment;
  next.ray.tmin = greater(t * (1.0f + 0x1p-21f), 1e-37f);
  next.weight *= 1.0f - alpha;
  ++next.layer;
  return next;
}

OCTRACE_HD inline float blend_alpha(const RenderParams& params, const Material& material,
                                    const Vec4& color, std::uint32_t layer) {
  const bool blends = params.alpha != 0 && material.alpha_mode == AlphaMode::blend;
  return blends && layer + 1 < kMaxLayers ? clamp01(color.w) : 1.0f;
}

// Adds up the connections of a shading point that nothing blocks.
template <class Scene, class Tracer>
OCTRACE_HD TraceStatus gather(const Scene& scene, const RenderParams& params,
                              const ShadingPoint& at, const Sampler& sampler,
                              std::uint32_t dimension, bool specular_sky, const Tracer& tracer,
                              RayCounts* counts, Vec3* radiance) {
  const std::uint32_t rays = lights_followed(scene) + 2;
  for (std::uint32_t i = 0; i < rays; ++i) {
    Connection connection;
    if (i == 0) {
      connection = sky_connection(params, at, sample_diffuse(at, sampler, dimension));
    } else if (i == 1) {
      if (!specular_sky) continue;
      connection = sky_connection(params, at, sample_specular(at, sampler, dimension));
    } else {
      connection = light_connection(scene, at, sampler, dimension, i - 2);
    }
    if (!(largest(connection.radiance) > 0.0f)) continue;
    ++(i < 2 ? counts->beauty : counts->shadow);
    float transmittance = 0.0f;
    const TraceStatus status = tracer.transmittance(scene, params, connection.ray, &transmittance);
    if (status != TraceStatus::ok) return status;
    *radiance += transmittance * connection.radiance;
  }
  return TraceStatus::ok;
}

OCTRACE_HD inline Segment reflection(const ShadingPoint& at, const BrdfSample& sample,
                                     Vec3 weight) {
  return {{at.origin, 0.0f, sample.direction, std::numeric_limits<float>::infinity()},
          terminator(at, sample.direction) * (weight * sample.weight),
          at.occlusion,
          kReflectionBlur * at.brdf.alpha,
          true,
          0};
}

OCTRACE_HD inline Vec3 bounded(Vec3 radiance) {
  return {lesser(greater(radiance.x, 0.0f), kMaxRadiance),
          lesser(greater(radiance.y, 0.0f), kMaxRadiance),
          lesser(greater(radiance.z, 0.0f), kMaxRadiance)};
}

// RGB: radiance of what `ray` sees, premultiplied; A: coverage.
template <class Scene, class Tracer>
OCTRACE_HD TraceStatus trace_path(const Scene& scene, const RenderParams& params, const Ray& ray,
                                  const Sampler& sampler, const Tracer& tracer, RayCounts* counts,
                                  Vec4* color) {
  Vec3 radiance(0.0f);
  float background = 0.0f;
  Segment segment{ray, Vec3(1.0f), 1.0f, 0.0f, false, 0};
  Segment later = segment;  // the camera ray behind the surface whose reflection is being followed
  bool is_later = false;
  for (;;) {
    HitOf<Scene> hit;
    ++counts->beauty;
    TraceStatus status = tracer.closest(scene, params, segment.ray, &hit);
    if (status != TraceStatus::ok) return status;
    bool goes_on = false;
    Segment next = segment;
    if (!hit.valid()) {
      if (!segment.reflected) background = segment.weight.x;
      if (segment.reflected || params.transparent_background == 0)
        radiance += bounded(segment.sky_weight * (segment.weight * params.sky));
    } else {
      const auto surface = make_surface(scene, segment.ray, hit);
      const SceneView& arrays = arrays_of(scene, hit);
      const Material& material = material_of(arrays, surface);
      const Vec4 base = base_color(arrays, surface);
      const float alpha = blend_alpha(params, material, base, segment.layer);
      next = behind(segment, hit.t, alpha);
      goes_on = largest(next.weight) > kLeastWeight;
      const Vec3 weight = alpha * segment.weight;
      if (alpha > 0.0f && material.unlit != 0) {
        radiance += bounded(weight * Vec3(base.x, base.y, base.z));
      } else if (alpha > 0.0f) {
        const Vec3 view = normalize_or(-segment.ray.direction, surface.geometric_normal);
        ShadingPoint at = make_shading_point(arrays, surface, view, base);
        at.brdf.alpha = lesser(greater(at.brdf.alpha, segment.blur), 1.0f);
        const std::uint32_t dimension =
            1 + kDimensions * (segment.layer + (segment.reflected ? kMaxLayers : 0));
        Vec3 seen = at.emission;
        status =
            gather(scene, params, at, sampler, dimension, segment.reflected, tracer, counts, &seen);
        if (status != TraceStatus::ok) return status;
        radiance += bounded(weight * seen);
        if (!segment.reflected) {
          const Segment mirrored = reflection(at, sample_specular(at, sampler, dimension), weight);
          if (largest(mirrored.weight) > kLeastWeight) {
            later = next;
            is_later = goes_on;
            segment = mirrored;
            continue;
          }
        }
      }
    }
    if (goes_on) {
      segment = next;
    } else if (segment.reflected && is_later) {
      segment = later;
      is_later = false;
    } else {
      break;
    }
  }
  *color = {radiance.x, radiance.y, radiance.z,
            params.transparent_background != 0 ? 1.0f - background : 1.0f};
  return TraceStatus::ok;
}

}  // namespace octrace::kernels
