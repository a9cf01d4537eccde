#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <iterator>
#include <map>

#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

constexpr const char* kClear = "{ pigment { rgbt <0,0,0,1> } finish { ambient 0 diffuse 0 } }";

// The mean of one channel over a texture: POV-Ray's finish knows no textures.
double mean_channel(const scene::Scene& scene, std::uint32_t index, int channel) {
  const kernels::Texture& texture = scene.textures[index];
  const std::uint64_t count = std::uint64_t{texture.width} * texture.height;
  std::uint64_t sum = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    sum += (scene.texels[texture.first_texel + i] >> (8 * channel)) & 0xffu;
  }
  return count > 0 ? static_cast<double>(sum) / (255.0 * static_cast<double>(count)) : 1.0;
}

struct Look {
  double metallic, roughness;
};

Look look_of(Job& job, const kernels::Material& material) {
  Look look{material.metallic, material.roughness};
  const std::uint32_t texture = material.metallic_roughness_texture.texture;
  if (texture != kernels::kNone) {
    look.metallic *= mean_channel(job.scene, texture, 2);
    look.roughness *= mean_channel(job.scene, texture, 1);
    job.note("metalness and roughness textures are replaced by their means");
  }
  look.metallic = std::clamp(look.metallic, 0.0, 1.0);
  look.roughness = std::clamp(look.roughness, 0.03, 1.0);
  return look;
}

// Diffuse by what is not metal; a highlight of the width of GGX's (a Blinn exponent of 2 / alpha^2
// - 2 has the same lobe); a mirror image of the surroundings, by Schlick's law, as far as the
// surface is smooth, and the sky's mean for the rest. `share` is the part of an average that the
// finish holds.
std::string finish_of(const Look& look, double share) {
  const double m = look.metallic, alpha = look.roughness * look.roughness;
  const double exponent = std::max(2.0 / (alpha * alpha) - 2.0, 1.0);
  const double mirror = (1.0 - look.roughness) * (1.0 - look.roughness);
  const double f0 = 0.04 * (1.0 - m) + m;
  return fmt::format(
      "finish {{ diffuse {:.6g} ambient {:.6g} specular albedo {:.6g} roughness {:.6g} "
      "metallic {:.6g} reflection {{ {:.6g}, {:.6g} falloff 5 metallic {:.6g} }} }}",
      share * (1.0 - m), share * (1.0 - m + m * (1.0 - mirror)), share * f0,
      std::clamp(1.0 / exponent, 0.0005, 1.0), m, share * f0 * mirror, share * mirror, m);
}

std::string color_text(const glm::dvec4& color, bool blend) {
  return fmt::format("rgbt <{:.9g},{:.9g},{:.9g},{:.9g}>", color.x, color.y, color.z,
                     blend ? 1.0 - std::clamp(color.w, 0.0, 1.0) : 0.0);
}

bool same_coordinates(const kernels::TextureRef& a, const kernels::TextureRef& b) {
  return a.texcoord == b.texcoord && a.transform_u == b.transform_u &&
         a.transform_v == b.transform_v;
}

// The one reference whose coordinates a mesh of this material carries.
const kernels::TextureRef* carried_uv(const kernels::Material& material) {
  if (material.base_color_texture.texture != kernels::kNone) return &material.base_color_texture;
  if (material.emissive_texture.texture != kernels::kNone) return &material.emissive_texture;
  return nullptr;
}

// What a material shows: base colour with its finish, plus emission of a colour of its own, which
// POV-Ray needs a second texture and an average for.
struct Surface {
  std::string base;      // a pigment
  std::string emission;  // a pigment; empty: none
  double emission_scale = 1.0;
};

std::string texture_text(const kernels::Material& material, const Look& look,
                         const Surface& surface) {
  if (material.unlit != 0) {
    return fmt::format("pigment {{ {} }} finish {{ emission 1 ambient 0 diffuse 0 }}",
                       surface.base);
  }
  if (surface.emission.empty()) {
    return fmt::format("pigment {{ {} }} {}", surface.base, finish_of(look, 1.0));
  }
  return fmt::format(
      "average texture_map {{ [1 pigment {{ {} }} {}] [1 pigment {{ {} }} finish {{ emission "
      "{:.9g} ambient 0 diffuse 0 }}] }}",
      surface.base, finish_of(look, 2.0), surface.emission, 2.0 * surface.emission_scale);
}

util::Result<Surface> surface_of(Job& job, std::uint32_t index) {
  const kernels::Material& material = job.scene.materials[index];
  const bool blend = job.options.alpha && material.alpha_mode == kernels::AlphaMode::blend;
  const kernels::TextureRef* carried = carried_uv(material);
  Surface surface;
  surface.base = color_text(glm::dvec4(material.base_color), blend);
  if (material.base_color_texture.texture != kernels::kNone) {
    const auto map =
        write_image_map(job, index, material.base_color_texture, glm::dvec4(material.base_color),
                        blend ? MapUse::color_and_alpha : MapUse::color, "color");
    if (!map) return map.error();
    surface.base = map->pigment;
  }

  const glm::dvec3 emissive(material.emissive);
  surface.emission_scale = std::max({emissive.x, emissive.y, emissive.z});
  if (!(surface.emission_scale > 0.0) || material.unlit != 0) return surface;
  const glm::dvec4 factor(emissive / surface.emission_scale, 1.0);
  surface.emission = color_text(factor, false);
  if (material.emissive_texture.texture == kernels::kNone) return surface;
  if (!same_coordinates(material.emissive_texture, *carried)) {
    job.note("an emissive texture with coordinates of its own is left out");
    surface.emission.clear();
    return surface;
  }
  const auto map =
      write_image_map(job, index, material.emissive_texture, factor, MapUse::color, "emission");
  if (!map) return map.error();
  surface.emission = map->pigment;
  return surface;
}

void note_what_is_missing(Job& job, const kernels::Material& material) {
  if (material.normal_texture.texture != kernels::kNone) job.note("normal textures are left out");
  if (material.occlusion_texture.texture != kernels::kNone)
    job.note("occlusion textures are left out");
}

// A solid texture for each colour among the vertices, for POV-Ray to blend between them.
void add_vertex_colors(Job& job, const kernels::Geometry& geometry, MeshStyle& style) {
  constexpr std::size_t kMaxTextures = 4096;
  const kernels::Material& material = job.scene.materials[geometry.material];
  const Look look = look_of(job, material);
  const bool blend = job.options.alpha && material.alpha_mode == kernels::AlphaMode::blend;
  for (const double levels : {255.0, 31.0, 7.0}) {
    std::map<std::uint32_t, std::uint32_t> known;
    style.textures.clear();
    style.vertex_textures.clear();
    for (std::uint32_t i = 0; i < geometry.vertex_count; ++i) {
      const glm::dvec4 color(job.scene.colors[std::size_t{geometry.colors} + i]);
      std::uint32_t key = 0;
      glm::dvec4 shown(material.base_color);
      for (int c = 0; c < 4; ++c) {
        const double level = std::round(std::clamp(color[c], 0.0, 1.0) * levels);
        key = key << 8 | static_cast<std::uint32_t>(level);
        shown[c] *= level / levels;
      }
      const auto [entry, added] =
          known.try_emplace(key, static_cast<std::uint32_t>(style.textures.size()));
      if (added) {
        style.textures.push_back(
            fmt::format("texture {{ {} }}",
                        texture_text(material, look, Surface{color_text(shown, blend), "", 1.0})));
      }
      style.vertex_textures.push_back(entry->second);
    }
    if (style.textures.size() <= kMaxTextures) return;
  }
}

}  // namespace

util::Result<void> append_scene_header(std::string& out, Job& job) {
  std::vector<bool> used(job.scene.materials.size(), false);
  for (const kernels::Geometry& geometry : job.scene.geometries) used[geometry.material] = true;
  auto to = std::back_inserter(out);
  out += '\n';
  for (std::uint32_t i = 0; i < job.scene.materials.size(); ++i) {
    if (!used[i]) continue;
    const kernels::Material& material = job.scene.materials[i];
    note_what_is_missing(job, material);
    const auto surface = surface_of(job, i);
    if (!surface) return surface.error();
    const std::string solid = texture_text(material, look_of(job, material), *surface);
    const bool mapped = carried_uv(material) != nullptr;
    std::string text = solid;
    if (is_cut(job, material)) {
      text = fmt::format("function {{ Cut{}(x,y,1) }} texture_map {{ [0.5 {}] [0.5 {}] }}", i,
                         "pigment { rgbt <0,0,0,1> } finish { ambient 0 diffuse 0 }", solid);
    }
    fmt::format_to(to, "#declare Material{} = texture {{ {}{} }}\n", i, mapped ? "uv_mapping " : "",
                   text);
  }
  append_lights(out, job);
  return {};
}

void append_scene_mesh(std::string& out, Job& job, std::uint32_t index) {
  const kernels::Geometry& geometry = job.scene.geometries[index];
  const kernels::Material& material = job.scene.materials[geometry.material];
  const bool culled = job.options.cull && material.double_sided == 0;
  MeshStyle style;
  style.uv = carried_uv(material);
  style.normals = true;
  style.reversed = true;
  const std::vector<std::uint32_t> triangles = kept_triangles(job, geometry, style);
  std::string texture = fmt::format("texture {{ Material{} }}\n", geometry.material);
  if (geometry.colors != kernels::kNone) {
    if (style.uv == nullptr && !is_cut(job, material)) {
      // The material itself stays: POV-Ray wants a texture outside where there is one inside.
      add_vertex_colors(job, geometry, style);
    } else {
      job.note("vertex colours are left out where a texture is");
    }
  }
  if (culled) texture += fmt::format("interior_texture {}\n", kClear);
  append_mesh(out, job, index, style, triangles, texture);
}

}  // namespace octrace::exporters::povray
