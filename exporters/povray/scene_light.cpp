#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>

#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

constexpr double kPi = 3.14159265358979323846;

// fade_power 2 dims by 2 / (1 + (d / fade_distance)^2): the inverse square of d, but for what lies
// nearer than a few fade distances.
constexpr double kFadeDistance = 1e-3;

std::string vector_text(const glm::dvec3& v) {
  return fmt::format("<{:.9g},{:.9g},{:.9g}>", v.x, v.y, v.z);
}

void append_directional(std::string& out, const glm::dvec3& direction,
                        const glm::dvec3& intensity) {
  // A diffuse surface of POV-Ray's returns the light's colour where glTF's returns lux / pi.
  fmt::format_to(std::back_inserter(out), "light_source {{ {} rgb {} parallel point_at 0 }}\n",
                 vector_text(-direction * (100.0 * kRadius)), vector_text(intensity / kPi));
}

void append_local(std::string& out, Job& job, const kernels::Light& light) {
  const glm::dvec3 position = job.fit(glm::dvec3(light.position));
  const double per_square_unit = job.fit.scale * job.fit.scale;
  const glm::dvec3 color =
      glm::dvec3(light.intensity) * per_square_unit / (2.0 * kPi * kFadeDistance * kFadeDistance);
  fmt::format_to(std::back_inserter(out), "light_source {{ {} rgb {} fade_distance {} fade_power 2",
                 vector_text(position), vector_text(color), kFadeDistance);
  if (light.type == kernels::LightType::spot) {
    // The cosines where KHR_lights_punctual's clamp reaches 0 and 1.
    const double outer = std::clamp(-double(light.spot_offset) / light.spot_scale, -1.0, 1.0);
    const double inner = std::clamp(outer + 1.0 / light.spot_scale, -1.0, 1.0);
    fmt::format_to(std::back_inserter(out),
                   " spotlight point_at {} radius {:.9g} falloff {:.9g} tightness 0",
                   vector_text(position + glm::dvec3(light.direction)),
                   std::acos(inner) * 180.0 / kPi, std::acos(outer) * 180.0 / kPi);
    job.note("spot lights fade by POV-Ray's spline between the cone's angles");
  }
  out += " }\n";
  if (std::isfinite(light.range)) job.note("the range of lights is not followed");
}

}  // namespace

void append_lights(std::string& out, Job& job) {
  out += '\n';
  job.note("light of the sky reaches into every corner");
  if (job.scene.lights.empty()) {
    // As octrace lights a scene that brings no light.
    append_directional(out, glm::normalize(glm::dvec3(-0.55, -0.8, -0.45)), {2.1, 1.95, 1.7});
    return;
  }
  for (const kernels::Light& light : job.scene.lights) {
    if (light.type == kernels::LightType::directional) {
      append_directional(out, glm::dvec3(light.direction), glm::dvec3(light.intensity));
    } else {
      append_local(out, job, light);
    }
  }
}

}  // namespace octrace::exporters::povray
