#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "exporters/gltf/parts.h"
#include "exporters/png.h"

namespace octrace::exporters {

namespace {

using Json = nlohmann::ordered_json;
using kernels::kNone;

int wrap_code(kernels::Wrap wrap) {
  switch (wrap) {
    case kernels::Wrap::clamp:
      return 33071;
    case kernels::Wrap::mirror:
      return 33648;
    case kernels::Wrap::repeat:
      break;
  }
  return 10497;
}

util::Result<void> append_textures(GltfJob& job) {
  const scene::Scene& scene = job.scene;
  std::map<std::uint64_t, int> images;  // by first texel: textures may share an image
  std::map<std::pair<int, std::pair<int, int>>, int> samplers;
  for (const kernels::Texture& texture : scene.textures) {
    auto image = images.find(texture.first_texel);
    if (image == images.end()) {
      const std::uint64_t count = std::uint64_t{texture.width} * texture.height;
      const auto png =
          encode_png(texture.width, texture.height,
                     std::span(scene.texels).subspan(texture.first_texel, count), job.folder);
      if (!png) return png.error();
      const int view = job.glb.add_view(*png, GlbBuilder::Target::none);
      const int index =
          job.glb.add("images", Json{{"bufferView", view}, {"mimeType", "image/png"}});
      image = images.emplace(texture.first_texel, index).first;
    }
    const int filter = texture.filter == kernels::Filter::nearest ? 9728 : 9729;
    const int wrap_s = wrap_code(texture.wrap_s), wrap_t = wrap_code(texture.wrap_t);
    auto sampler = samplers.find({filter, {wrap_s, wrap_t}});
    if (sampler == samplers.end()) {
      const int index = job.glb.add(
          "samplers",
          Json{{"magFilter", filter}, {"minFilter", filter}, {"wrapS", wrap_s}, {"wrapT", wrap_t}});
      sampler = samplers.insert({{filter, {wrap_s, wrap_t}}, index}).first;
    }
    job.glb.add("textures", Json{{"sampler", sampler->second}, {"source", image->second}});
  }
  return {};
}

// KHR_texture_transform says offset, rotation and scale: the columns of its matrix are orthogonal
// in (u, v) before scaling, as in every file that the matrix can have come from.
void append_transform(GltfJob& job, const kernels::TextureRef& ref, Json& info) {
  const kernels::Vec3 &u = ref.transform_u, &v = ref.transform_v;
  if (u == kernels::Vec3(1, 0, 0) && v == kernels::Vec3(0, 1, 0)) return;
  const double rotation = std::atan2(-double(v.x), double(u.x));
  const double c = std::cos(rotation), s = std::sin(rotation);
  const double scale_u = c * u.x - s * v.x, scale_v = s * u.y + c * v.y;
  const double error = std::max(std::abs(u.y - s * scale_v), std::abs(v.y - c * scale_v));
  if (error > 1e-5 * std::max(1.0, std::abs(scale_v))) {
    job.note("a texture transform with shear lost it");
  }
  info["extensions"]["KHR_texture_transform"] =
      Json{{"offset", {u.z, v.z}}, {"rotation", rotation}, {"scale", {scale_u, scale_v}}};
  job.glb.use_extension("KHR_texture_transform");
}

void append_reference(GltfJob& job, const kernels::TextureRef& ref, Json& owner, const char* name,
                      const char* strength_name = nullptr, double strength = 1.0) {
  if (ref.texture == kNone) return;
  Json info{{"index", ref.texture}};
  if (ref.texcoord != 0) info["texCoord"] = ref.texcoord;
  if (strength_name != nullptr && strength != 1.0) info[strength_name] = strength;
  append_transform(job, ref, info);
  owner[name] = std::move(info);
}

Json vector_of(const kernels::Vec4& v) { return {v.x, v.y, v.z, v.w}; }

void append_emission(GltfJob& job, const kernels::Material& material, Json& record) {
  const kernels::Vec3& e = material.emissive;
  const float most = std::max({e.x, e.y, e.z});
  if (most > 0.0f) {
    const float strength = std::max(most, 1.0f);
    // Rounding may lift a quotient above the 1 that glTF allows.
    record["emissiveFactor"] = {std::min(e.x / strength, 1.0f), std::min(e.y / strength, 1.0f),
                                std::min(e.z / strength, 1.0f)};
    if (strength > 1.0f) {
      record["extensions"]["KHR_materials_emissive_strength"] = {{"emissiveStrength", strength}};
      job.glb.use_extension("KHR_materials_emissive_strength");
    }
  }
  append_reference(job, material.emissive_texture, record, "emissiveTexture");
}

Json material_record(GltfJob& job, const kernels::Material& material, const std::string& name) {
  Json record;
  if (!name.empty()) record["name"] = name;
  Json pbr{{"baseColorFactor", vector_of(material.base_color)},
           {"metallicFactor", material.metallic},
           {"roughnessFactor", material.roughness}};
  append_reference(job, material.base_color_texture, pbr, "baseColorTexture");
  append_reference(job, material.metallic_roughness_texture, pbr, "metallicRoughnessTexture");
  record["pbrMetallicRoughness"] = std::move(pbr);
  append_reference(job, material.normal_texture, record, "normalTexture", "scale",
                   material.normal_scale);
  append_reference(job, material.occlusion_texture, record, "occlusionTexture", "strength",
                   material.occlusion_strength);
  append_emission(job, material, record);
  if (material.alpha_mode == kernels::AlphaMode::mask) {
    record["alphaMode"] = "MASK";
    record["alphaCutoff"] = material.alpha_cutoff;
  } else if (material.alpha_mode == kernels::AlphaMode::blend) {
    record["alphaMode"] = "BLEND";
  }
  if (material.double_sided != 0) record["doubleSided"] = true;
  if (material.unlit != 0) {
    record["extensions"]["KHR_materials_unlit"] = Json::object();
    job.glb.use_extension("KHR_materials_unlit");
  }
  return record;
}

}  // namespace

int texcoord_sets(const kernels::Material& material) {
  int sets = 0;
  for (const kernels::TextureRef* ref :
       {&material.base_color_texture, &material.metallic_roughness_texture,
        &material.normal_texture, &material.occlusion_texture, &material.emissive_texture}) {
    if (ref->texture != kNone) sets = std::max(sets, static_cast<int>(ref->texcoord) + 1);
  }
  return sets;
}

util::Result<void> append_materials(GltfJob& job) {
  if (auto done = append_textures(job); !done) return done;
  for (std::size_t i = 0; i < job.scene.materials.size(); ++i) {
    const std::string name =
        i < job.scene.material_names.size() ? job.scene.material_names[i] : std::string();
    job.glb.add("materials", material_record(job, job.scene.materials[i], name));
  }
  return {};
}

}  // namespace octrace::exporters
