// Attribute formats (glTF 2.0, 3.7.2; KHR_mesh_quantization) and counts.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <string_view>

#include "backend/gltf/accessor.h"
#include "backend/gltf/links.h"

namespace octrace::gltf {
namespace {

// Component formats as bits, so that a semantic's choice is one number.
enum Format : unsigned {
  kFloat = 1,
  kByte = 2,
  kByteNormalised = 4,
  kUbyte = 8,
  kUbyteNormalised = 16,
  kShort = 32,
  kShortNormalised = 64,
  kUshort = 128,
  kUshortNormalised = 256,
  kUint = 512,
};
constexpr unsigned kUnsignedNormalised = kUbyteNormalised | kUshortNormalised;
constexpr unsigned kSignedNormalised = kByteNormalised | kShortNormalised;
constexpr unsigned kSignedAny = kSignedNormalised | kByte | kShort;
constexpr unsigned kAnySmall = kSignedAny | kUnsignedNormalised | kUbyte | kUshort;

unsigned format_of(const tinygltf::Accessor& accessor) {
  const bool n = accessor.normalized;
  switch (accessor.componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return n ? kByteNormalised : kByte;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return n ? kUbyteNormalised : kUbyte;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return n ? kShortNormalised : kShort;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return n ? kUshortNormalised : kUshort;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return kUint;
    default:
      return kFloat;
  }
}

struct Allowed {
  std::array<int, 2> types{};  // tinygltf's; the second may repeat the first
  unsigned formats = 0;
};

Allowed allowed_for(std::string_view semantic, bool target, bool quantised) {
  const unsigned extra = quantised ? ~0u : 0u;
  if (semantic == "POSITION") {
    return {{TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC3},
            kFloat | (extra & (target ? kSignedAny : kAnySmall))};
  }
  if (semantic == "NORMAL") {
    return {{TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC3}, kFloat | (extra & kSignedNormalised)};
  }
  if (semantic == "TANGENT") {
    // A morph target moves the direction only, not the sign in w.
    const int type = target ? TINYGLTF_TYPE_VEC3 : TINYGLTF_TYPE_VEC4;
    return {{type, type}, kFloat | (extra & kSignedNormalised)};
  }
  const unsigned deltas = target ? kSignedNormalised : 0u;
  if (semantic.starts_with("TEXCOORD_")) {
    return {{TINYGLTF_TYPE_VEC2, TINYGLTF_TYPE_VEC2},
            kFloat | kUnsignedNormalised | deltas | (extra & (target ? kSignedAny : kAnySmall))};
  }
  if (semantic.starts_with("COLOR_")) {
    return {{TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, kFloat | kUnsignedNormalised | deltas};
  }
  if (semantic.starts_with("JOINTS_")) {
    return {{TINYGLTF_TYPE_VEC4, TINYGLTF_TYPE_VEC4}, kUbyte | kUshort};
  }
  return {{TINYGLTF_TYPE_VEC4, TINYGLTF_TYPE_VEC4}, kFloat | kUnsignedNormalised};  // WEIGHTS_
}

struct PrimitiveCheck {
  const tinygltf::Model& model;
  const tinygltf::Primitive& primitive;
  std::string pointer;
  bool quantised;
  Issues& issues;

  const tinygltf::Accessor& accessor(int i) const {
    return model.accessors[static_cast<std::size_t>(i)];
  }

  void check_format(const std::string& place, const std::string& name, int index, bool target) {
    const auto& a = accessor(index);
    if (name.starts_with('_')) {
      if (format_of(a) == kUint) {
        issues.invalid("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_UNSIGNED_INT", place,
                       "an attribute cannot be UNSIGNED_INT");
      }
      return;
    }
    if (target && (name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_"))) {
      issues.invalid("MESH_PRIMITIVE_INVALID_ATTRIBUTE", place,
                     "joints and weights cannot be morphed");
      return;
    }
    const Allowed allowed = allowed_for(name, target, quantised);
    const bool type_fits =
        std::find(allowed.types.begin(), allowed.types.end(), a.type) != allowed.types.end();
    if (!type_fits || (format_of(a) & allowed.formats) == 0) {
      issues.invalid("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT", place,
                     fmt::format("accessor {} is {}, which {} cannot be", index,
                                 format_name(a.type, a.componentType, a.normalized), name));
    }
  }

  void check_attributes() {
    const auto& attributes = primitive.attributes;
    const std::size_t count = accessor(attributes.begin()->second).count;
    for (const auto& [name, index] : attributes) {
      const std::string place = pointer + "/attributes/" + pointer_key(name);
      check_format(place, name, index, false);
      if (accessor(index).count != count) {
        issues.invalid("MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT", place,
                       fmt::format("has {} elements, {} has {}", accessor(index).count,
                                   attributes.begin()->first, count));
      }
    }
    for (std::size_t t = 0; t < primitive.targets.size() && !issues.failed(); ++t) {
      for (const auto& [name, index] : primitive.targets[t]) {
        const std::string place = fmt::format("{}/targets/{}/{}", pointer, t, pointer_key(name));
        check_format(place, name, index, true);
        if (accessor(index).count != count) {
          issues.invalid("MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT", place,
                         fmt::format("has {} elements, the primitive has {} vertices",
                                     accessor(index).count, count));
        }
      }
    }
    if (!attributes.contains("POSITION")) {
      issues.warn("MESH_PRIMITIVE_NO_POSITION", pointer + "/attributes",
                  "nothing of this primitive can be seen");
    }
  }

  void check_indices() {
    if (primitive.indices < 0) return;
    const auto& a = accessor(primitive.indices);
    const std::string place = pointer + "/indices";
    if (a.type != TINYGLTF_TYPE_SCALAR || (format_of(a) & (kUbyte | kUshort | kUint)) == 0) {
      issues.invalid("MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT", place,
                     fmt::format("needs unsigned integers, accessor {} is {}", primitive.indices,
                                 format_name(a.type, a.componentType, a.normalized)));
    } else if (a.bufferView >= 0 &&
               model.bufferViews[static_cast<std::size_t>(a.bufferView)].byteStride != 0) {
      issues.invalid("MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE", place,
                     fmt::format("buffer view {} has a stride", a.bufferView));
    }
  }

  void check_mode() {
    const std::size_t count = primitive.indices >= 0
                                  ? accessor(primitive.indices).count
                                  : accessor(primitive.attributes.begin()->second).count;
    const bool fits = [&] {
      switch (primitive.mode) {
        case TINYGLTF_MODE_LINE:
          return count % 2 == 0;
        case TINYGLTF_MODE_LINE_LOOP:
        case TINYGLTF_MODE_LINE_STRIP:
          return count >= 2;
        case TINYGLTF_MODE_TRIANGLES:
          return count % 3 == 0;
        case TINYGLTF_MODE_TRIANGLE_STRIP:
        case TINYGLTF_MODE_TRIANGLE_FAN:
          return count >= 3;
        default:
          return true;
      }
    }();
    if (!fits) {
      issues.warn("MESH_PRIMITIVE_INCOMPATIBLE_MODE", pointer,
                  fmt::format("{} vertices do not make whole primitives of mode {}", count,
                              primitive.mode));
    }
  }

  void check_texture_coordinates(int material, const std::string& place) {
    if (material < 0) return;
    const auto& m = model.materials[static_cast<std::size_t>(material)];
    const auto needs = [&](const char* name, int index, int set,
                           const tinygltf::ExtensionMap& ext) {
      if (index < 0) return;
      const auto transform = ext.find("KHR_texture_transform");
      if (transform != ext.end() && transform->second.Has("texCoord")) {
        set = transform->second.Get("texCoord").GetNumberAsInt();
      }
      if (primitive.attributes.contains(fmt::format("TEXCOORD_{}", set))) return;
      issues.invalid("MESH_PRIMITIVE_TOO_FEW_TEXCOORDS", pointer + place,
                     fmt::format("{} of material {} needs TEXCOORD_{}, which the primitive does "
                                 "not have",
                                 name, material, set));
    };
    const auto& pbr = m.pbrMetallicRoughness;
    const auto check = [&](const char* name, const auto& info) {
      needs(name, info.index, info.texCoord, info.extensions);
    };
    check("baseColorTexture", pbr.baseColorTexture);
    check("metallicRoughnessTexture", pbr.metallicRoughnessTexture);
    check("normalTexture", m.normalTexture);
    check("occlusionTexture", m.occlusionTexture);
    check("emissiveTexture", m.emissiveTexture);
  }

  // The primitive's own and those of KHR_materials_variants.
  void check_materials() {
    check_texture_coordinates(primitive.material, "/material");
    const auto variants = primitive.extensions.find("KHR_materials_variants");
    if (variants == primitive.extensions.end()) return;
    const tinygltf::Value& mappings = variants->second.Get("mappings");
    for (std::size_t i = 0; i < mappings.ArrayLen(); ++i) {
      check_texture_coordinates(
          mappings.Get(static_cast<int>(i)).Get("material").GetNumberAsInt(),
          fmt::format("/extensions/KHR_materials_variants/mappings/{}/material", i));
    }
  }
};

}  // namespace

void check_mesh_links(const tinygltf::Model& model, Issues& issues) {
  const bool quantised = std::find(model.extensionsUsed.begin(), model.extensionsUsed.end(),
                                   "KHR_mesh_quantization") != model.extensionsUsed.end();
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    const auto& primitives = model.meshes[m].primitives;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      PrimitiveCheck check{model, primitives[p], fmt::format("/meshes/{}/primitives/{}", m, p),
                           quantised, issues};
      check.check_attributes();
      check.check_indices();
      if (issues.failed()) return;
      check.check_mode();
      check.check_materials();
      if (issues.failed()) return;
    }
  }
}

}  // namespace octrace::gltf
