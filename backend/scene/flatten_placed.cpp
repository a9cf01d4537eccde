#include "backend/scene/flatten_placed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>

#include "backend/scene/names.h"

namespace octrace::scene {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

util::Result<void> check_place(const gltf::Document& document, int node, const glm::dmat4& world,
                               const char* what) {
  bool fits = true;
  for (int i = 0; i < 16; ++i) fits &= std::isfinite(world[i / 4][i % 4]);
  for (int i = 0; i < 3; ++i) fits &= std::abs(world[3][i]) <= double{kMaxCoordinate};
  if (fits) return {};
  return util::Error{util::Exit::unsupported, "",
                     fmt::format("places a {} beyond {:g} m or nowhere; positions must be finite "
                                 "and within that",
                                 what, kMaxCoordinate),
                     document.file, fmt::format("/nodes/{}", node)};
}

Camera convert(const tinygltf::Camera& source) {
  Camera camera;
  if (source.type == "orthographic") {
    camera.type = CameraType::orthographic;
    camera.xmag = source.orthographic.xmag;
    camera.ymag = source.orthographic.ymag;
    camera.znear = source.orthographic.znear;
    camera.zfar = source.orthographic.zfar;
    return camera;
  }
  camera.yfov = source.perspective.yfov;
  camera.znear = source.perspective.znear;
  // Absent means infinite; tinygltf says so by 0.
  if (source.perspective.zfar > 0.0) camera.zfar = source.perspective.zfar;
  return camera;
}

kernels::Vec3 shining_direction(const glm::dmat4& world) {
  const glm::dvec3 axis = -glm::dvec3(world[2]);
  const double length = std::sqrt(glm::dot(axis, axis));
  return length > 0.0 && std::isfinite(length) ? kernels::Vec3(axis / length)
                                               : kernels::Vec3(0.0f, 0.0f, -1.0f);
}

std::optional<kernels::Light> convert(const tinygltf::Light& source, const glm::dmat4& world) {
  kernels::Light light{};
  if (source.type == "directional") {
    light.type = kernels::LightType::directional;
  } else if (source.type == "point") {
    light.type = kernels::LightType::point;
  } else if (source.type == "spot") {
    light.type = kernels::LightType::spot;
    // The extension's own formula and its bound on the width of the penumbra.
    const double inner = std::cos(source.spot.innerConeAngle);
    const double outer = std::cos(source.spot.outerConeAngle);
    const double scale = 1.0 / std::max(0.001, inner - outer);
    light.spot_scale = static_cast<float>(scale);
    light.spot_offset = static_cast<float>(-outer * scale);
  } else {
    return std::nullopt;
  }
  light.position = kernels::Vec3(glm::dvec3(world[3]));
  light.direction = shining_direction(world);
  for (std::size_t c = 0; c < 3; ++c) {
    const double color = c < source.color.size() ? source.color[c] : 1.0;
    light.intensity[static_cast<int>(c)] =
        static_cast<float>(std::clamp(color * source.intensity, 0.0, double{FLT_MAX}));
  }
  light.range =
      source.range > 0.0 ? static_cast<float>(std::min(source.range, double{FLT_MAX})) : kInfinity;
  return light;
}

}  // namespace

util::Result<void> place_cameras(const gltf::Document& document, const std::vector<int>& nodes,
                                 const std::vector<glm::dmat4>& worlds, Scene& scene) {
  const tinygltf::Model& model = document.model;
  for (const int node : nodes) {
    const int index = model.nodes[node].camera;
    if (index < 0) continue;
    if (auto ok = check_place(document, node, worlds[node], "camera"); !ok) return ok;
    Camera camera = convert(model.cameras[index]);
    camera.name = model.nodes[node].name.empty() ? name_of(model.cameras, index, "camera")
                                                 : model.nodes[node].name;
    camera.matrix = worlds[node];
    scene.cameras.push_back(std::move(camera));
  }
  return {};
}

util::Result<void> place_lights(const gltf::Document& document, const std::vector<int>& nodes,
                                const std::vector<glm::dmat4>& worlds, Scene& scene) {
  const tinygltf::Model& model = document.model;
  for (const int node : nodes) {
    const auto entry = model.nodes[node].extensions.find("KHR_lights_punctual");
    if (entry == model.nodes[node].extensions.end()) continue;
    const std::string pointer = fmt::format("/nodes/{}/extensions/KHR_lights_punctual/light", node);
    if (!entry->second.IsObject() || !entry->second.Has("light") ||
        !entry->second.Get("light").IsNumber()) {
      return util::Error{util::Exit::invalid_input, "UNDEFINED_PROPERTY", "needs a light's index",
                         document.file, pointer};
    }
    const int index = entry->second.Get("light").GetNumberAsInt();
    if (index < 0 || static_cast<std::size_t>(index) >= model.lights.size()) {
      return util::Error{util::Exit::invalid_input, "UNRESOLVED_REFERENCE",
                         fmt::format("names light {}, there are {}", index, model.lights.size()),
                         document.file, pointer};
    }
    if (auto ok = check_place(document, node, worlds[node], "light"); !ok) return ok;
    if (const auto light = convert(model.lights[index], worlds[node])) {
      scene.lights.push_back(*light);
    } else {
      scene.warnings.push_back(fmt::format("light \"{}\" is left out: its type \"{}\" is unknown",
                                           printable(name_of(model.lights, index, "light")),
                                           printable(model.lights[index].type)));
    }
  }
  return {};
}

}  // namespace octrace::scene
