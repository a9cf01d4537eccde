// Images, textures, samplers and materials with the extensions that octrace reads.
#include <fmt/format.h>

#include <array>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr std::array<std::int64_t, 2> kMagFilters{9728, 9729};
constexpr std::array<std::int64_t, 6> kMinFilters{9728, 9729, 9984, 9985, 9986, 9987};
constexpr std::array<std::int64_t, 3> kWraps{33071, 33648, 10497};
constexpr std::array<std::string_view, 3> kAlphaModes{"OPAQUE", "MASK", "BLEND"};

// glTF asks for consecutive sets; octrace interpolates two, and more than this is no real file.
constexpr std::int64_t kMaxTexCoord = 255;
constexpr double kUnbounded = std::numeric_limits<float>::max();

// A texture info; `factor` is the extra number of normalTexture ("scale") and occlusionTexture.
void check_texture_info(const JsonRef& parent, std::string_view key, const Sizes& sizes,
                        std::string_view factor = {}) {
  const JsonRef info = parent.member(key).as_object();
  if (!info) return;
  check_common(info);
  (void)info.required("index").as_index(sizes.textures, "texture");
  (void)info.member("texCoord").as_integer(0, kMaxTexCoord);
  if (factor == "scale") (void)info.member(factor).as_number();
  if (factor == "strength") (void)info.member(factor).as_number(0, 1);
  const JsonRef extensions = info.member("extensions");
  const JsonRef transform = extensions.member("KHR_texture_transform");
  if (!transform) return;
  (void)transform.member("texCoord").as_integer(0, kMaxTexCoord);
  (void)transform.member("rotation").as_number();
  for (const auto* pair : {"offset", "scale"}) {
    const JsonRef value = transform.member(pair);
    if (value) (void)value.as_numbers(2);
  }
}

void check_numbers(const JsonRef& parent, std::string_view key, std::size_t count, double lowest,
                   double highest) {
  const JsonRef value = parent.member(key);
  if (value) (void)value.as_numbers(count, lowest, highest);
}

// Read by the scene to approximate the surface.
void check_specular_glossiness(const JsonRef& specular, const Sizes& sizes) {
  if (!specular) return;
  check_numbers(specular, "diffuseFactor", 4, 0, 1);
  check_numbers(specular, "specularFactor", 3, 0, 1);
  (void)specular.member("glossinessFactor").as_number(0, 1);
  check_texture_info(specular, "diffuseTexture", sizes);
  check_texture_info(specular, "specularGlossinessTexture", sizes);
}

void check_material(const JsonRef& material, const Sizes& sizes) {
  check_common(material);
  const JsonRef pbr = material.member("pbrMetallicRoughness").as_object();
  if (pbr) {
    check_common(pbr);
    check_numbers(pbr, "baseColorFactor", 4, 0, 1);
    (void)pbr.member("metallicFactor").as_number(0, 1);
    (void)pbr.member("roughnessFactor").as_number(0, 1);
    check_texture_info(pbr, "baseColorTexture", sizes);
    check_texture_info(pbr, "metallicRoughnessTexture", sizes);
  }
  check_texture_info(material, "normalTexture", sizes, "scale");
  check_texture_info(material, "occlusionTexture", sizes, "strength");
  check_texture_info(material, "emissiveTexture", sizes);
  check_numbers(material, "emissiveFactor", 3, 0, 1);
  (void)material.member("alphaMode").as_one_of(kAlphaModes);
  (void)material.member("alphaCutoff").as_number(0, kUnbounded);
  (void)material.member("doubleSided").as_boolean();
  const JsonRef extensions = material.member("extensions");
  const JsonRef emissive = extensions.member("KHR_materials_emissive_strength");
  (void)emissive.member("emissiveStrength").as_number(0, kUnbounded);
  const JsonRef specular = extensions.member("KHR_materials_pbrSpecularGlossiness");
  check_specular_glossiness(specular, sizes);
}

}  // namespace

void check_images(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "images", [&](const JsonRef& image) {
    check_common(image);
    const JsonRef uri = image.member("uri");
    const JsonRef view = image.member("bufferView");
    (void)uri.as_string();
    (void)image.member("mimeType").as_string();
    const int index = view.as_index(sizes.buffer_views, "buffer view");
    if (uri && view) image.invalid("ONE_OF_MISMATCH", "has both uri and bufferView");
    if (!uri && !view) image.invalid("ONE_OF_MISMATCH", "needs uri or bufferView");
    if (view && !image.member("mimeType")) {
      view.invalid("UNSATISFIED_DEPENDENCY", "needs mimeType beside it");
    }
    if (index < 0 || root.issues().failed()) return;
    const JsonRef views = root.member("bufferViews");
    const JsonRef data = views.element(static_cast<std::size_t>(index));
    if (data.member("byteStride")) {
      view.invalid("IMAGE_BUFFER_VIEW_WITH_BYTESTRIDE",
                   fmt::format("buffer view {} has a stride", index));
    }
  });
  each_object(root, "samplers", [&](const JsonRef& sampler) {
    check_common(sampler);
    (void)sampler.member("magFilter").as_one_of(kMagFilters);
    (void)sampler.member("minFilter").as_one_of(kMinFilters);
    (void)sampler.member("wrapS").as_one_of(kWraps);
    (void)sampler.member("wrapT").as_one_of(kWraps);
  });
  each_object(root, "textures", [&](const JsonRef& texture) {
    check_common(texture);
    (void)texture.member("sampler").as_index(sizes.samplers, "sampler");
    (void)texture.member("source").as_index(sizes.images, "image");
    const JsonRef extensions = texture.member("extensions");
    extensions.each_member([&](std::string_view, const JsonRef& extension) {
      // Every texture extension there is names its image "source".
      (void)extension.member("source").as_index(sizes.images, "image");
    });
  });
}

void check_materials(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "materials", [&](const JsonRef& material) { check_material(material, sizes); });
}

}  // namespace octrace::gltf
