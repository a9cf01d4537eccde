#include "backend/scene/flatten_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <set>

#include "backend/scene/names.h"
#include "backend/scene/texture_store.h"

namespace octrace::scene {

namespace {

using kernels::Material;
using kernels::TextureRef;
using tinygltf::Value;

// Numbers that float cannot hold become its largest, not infinity.
float to_float(double value) {
  return static_cast<float>(std::clamp(value, -double{FLT_MAX}, double{FLT_MAX}));
}

float component(const std::vector<double>& values, std::size_t index, double otherwise) {
  return to_float(index < values.size() ? values[index] : otherwise);
}

const Value* extension(const tinygltf::ExtensionMap& extensions, const char* name) {
  const auto entry = extensions.find(name);
  return entry != extensions.end() && entry->second.IsObject() ? &entry->second : nullptr;
}

double number(const Value& object, const char* key, double otherwise) {
  return object.Has(key) && object.Get(key).IsNumber() ? object.Get(key).GetNumberAsDouble()
                                                       : otherwise;
}

double element(const Value& object, const char* key, int index, double otherwise) {
  if (!object.Has(key)) return otherwise;
  const Value& array = object.Get(key);
  return array.IsArray() && array.ArrayLen() == 2 && array.Get(index).IsNumber()
             ? array.Get(index).GetNumberAsDouble()
             : otherwise;
}

// KHR_texture_transform: scaled, then rotated, then moved. The specification's text, its example
// ("the lower left quadrant, rotated clockwise": offset (0, 1), rotation pi/2, scale 0.5) and the
// conformance model mean a rotation that is counter-clockwise as the image is seen, v pointing
// down. The GLSL in the same text turns the other way.
void apply_transform(const Value& transform, TextureRef& ref) {
  const double angle = number(transform, "rotation", 0.0);
  const double s = std::sin(angle), c = std::cos(angle);
  const double scale_u = element(transform, "scale", 0, 1.0);
  const double scale_v = element(transform, "scale", 1, 1.0);
  ref.transform_u = {to_float(c * scale_u), to_float(s * scale_v),
                     to_float(element(transform, "offset", 0, 0.0))};
  ref.transform_v = {to_float(-s * scale_u), to_float(c * scale_v),
                     to_float(element(transform, "offset", 1, 0.0))};
}

class Converter {
 public:
  Converter(const gltf::Document& document, const FlattenOptions& options, Scene& scene)
      : document_(document), options_(options), textures_(document, options), scene_(scene) {}

  util::Result<void> convert(bool default_material) {
    const auto& materials = document_.model.materials;
    for (std::size_t i = 0; i < materials.size(); ++i) {
      scene_.materials.push_back(convert(materials[i], i));
      scene_.material_names.push_back(name_of(materials, i, "material"));
    }
    if (default_material || materials.empty()) {
      scene_.materials.emplace_back();
      scene_.material_names.push_back("default");
    }
    if (auto ok = textures_.load(scene_); !ok) return ok;
    for (Material& material : scene_.materials) {
      for (TextureRef* ref :
           {&material.base_color_texture, &material.metallic_roughness_texture,
            &material.normal_texture, &material.occlusion_texture, &material.emissive_texture}) {
        ref->texture = textures_.index_of(ref->texture);
      }
    }
    scene_.warnings.insert(scene_.warnings.end(), textures_.warnings().begin(),
                           textures_.warnings().end());
    return {};
  }

 private:
  Material convert(const tinygltf::Material& source, std::size_t index) {
    Material material;
    const tinygltf::PbrMetallicRoughness& pbr = source.pbrMetallicRoughness;
    for (int c = 0; c < 4; ++c) material.base_color[c] = component(pbr.baseColorFactor, c, 1.0);
    material.metallic = to_float(pbr.metallicFactor);
    material.roughness = to_float(pbr.roughnessFactor);
    double strength = 1.0;
    if (const Value* emission = extension(source.extensions, "KHR_materials_emissive_strength")) {
      strength = std::max(0.0, number(*emission, "emissiveStrength", 1.0));
    }
    for (int c = 0; c < 3; ++c) {
      material.emissive[c] = to_float(strength * component(source.emissiveFactor, c, 0.0));
    }
    material.alpha_cutoff = to_float(source.alphaCutoff);
    if (source.alphaMode == "MASK") material.alpha_mode = kernels::AlphaMode::mask;
    if (source.alphaMode == "BLEND") material.alpha_mode = kernels::AlphaMode::blend;
    material.double_sided = source.doubleSided ? 1 : 0;
    material.unlit = extension(source.extensions, "KHR_materials_unlit") != nullptr ? 1 : 0;
    material.normal_scale = to_float(source.normalTexture.scale);
    material.occlusion_strength = to_float(source.occlusionTexture.strength);

    name_ = printable(name_of(document_.model.materials, index, "material"));
    const bool all = options_.need_textures;
    const bool alpha = material.alpha_mode == kernels::AlphaMode::mask;
    material.base_color_texture = reference(pbr.baseColorTexture, true, all || alpha);
    material.metallic_roughness_texture = reference(pbr.metallicRoughnessTexture, false, all);
    material.normal_texture = reference(source.normalTexture, false, all);
    material.occlusion_texture = reference(source.occlusionTexture, false, all);
    material.emissive_texture = reference(source.emissiveTexture, true, all);
    return material;
  }

  // The three kinds of texture info share these members, but no base class.
  template <class TextureInfo>
  TextureRef reference(const TextureInfo& info, bool srgb, bool needed) {
    TextureRef ref;
    if (info.index < 0 || !needed) return ref;
    int texcoord = info.texCoord;
    if (const Value* transform = extension(info.extensions, "KHR_texture_transform")) {
      apply_transform(*transform, ref);
      texcoord = static_cast<int>(number(*transform, "texCoord", texcoord));
    }
    if (texcoord < 0 || texcoord > 1) {
      scene_.warnings.push_back(
          fmt::format("material \"{}\" uses TEXCOORD_{}; octrace follows sets 0 and 1, and uses "
                      "the factor alone",
                      name_, texcoord));
      return TextureRef{};
    }
    ref.texcoord = static_cast<std::uint32_t>(texcoord);
    ref.texture = textures_.request(info.index, srgb);
    return ref;
  }

  const gltf::Document& document_;
  const FlattenOptions& options_;
  TextureStore textures_;
  Scene& scene_;
  std::string name_;
};

}  // namespace

util::Result<void> place_materials(const gltf::Document& document, const FlattenOptions& options,
                                   bool default_material, Scene& scene) {
  return Converter(document, options, scene).convert(default_material);
}

}  // namespace octrace::scene
