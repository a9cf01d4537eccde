// KHR_lights_punctual: what reaches a point from a light, before shadows.
#pragma once

#include <limits>

#include "kernels/scene_view.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

struct Illumination {
  Vec3 to_light;    // a shadow ray's direction, not unit
  float end;        // and its tmax: 1 for lights at a place, +infinity for directional ones
  Vec3 direction;   // unit, towards the light
  Vec3 irradiance;  // on a surface that faces the light; 0: out of range or of the cone
};

// A scene without lights is lit by a warm sun from the left, above and in front (+z): about 70
// degrees off the view that frames a scene without a camera, which stands on the right.
OCTRACE_HD inline Light default_light() {
  Light light{};
  light.type = LightType::directional;
  light.direction = normalize_or(Vec3(0.55f, -0.75f, -0.45f), Vec3(0.0f, -1.0f, 0.0f));
  light.intensity = Vec3(2.2f, 2.02f, 1.75f);
  light.range = std::numeric_limits<float>::infinity();
  return light;
}

OCTRACE_HD inline std::uint32_t light_count(const SceneView& scene) {
  return scene.lights.empty() ? 1 : static_cast<std::uint32_t>(scene.lights.size);
}
OCTRACE_HD inline Light light_at(const SceneView& scene, std::uint32_t index) {
  return scene.lights.empty() ? default_light() : scene.lights[index];
}

OCTRACE_HD inline Illumination illuminate(const Light& light, Vec3 point) {
  if (light.type == LightType::directional)
    return {-light.direction, std::numeric_limits<float>::infinity(), -light.direction,
            light.intensity};
  const Vec3 to_light = light.position - point;
  const float distance = length(to_light);
  Illumination result{to_light, 1.0f, normalize_or(to_light, Vec3(0.0f)), Vec3(0.0f)};
  if (!(distance > 0.0f) || !is_finite(distance) || !(distance < light.range)) return result;
  float attenuation = 1.0f / distance / distance;
  if (is_finite(light.range)) {
    const float ratio = distance / light.range, squared = ratio * ratio;
    attenuation *= clamp01(1.0f - squared * squared);
  }
  if (light.type == LightType::spot) {
    const float cosine = -dot(light.direction, result.direction);
    const float cone = clamp01(cosine * light.spot_scale + light.spot_offset);
    attenuation *= cone * cone;
  }
  result.irradiance = attenuation * light.intensity;
  return result;
}

}  // namespace octrace::kernels
