// KHR_materials_variants: the names of variants, and each primitive's mapping to materials.
#include <fmt/format.h>

#include <set>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr const char* kVariants = "KHR_materials_variants";

void check_mappings(const JsonRef& primitive, const Sizes& sizes) {
  const JsonRef extensions = primitive.member("extensions");
  const JsonRef json = extensions.member(kVariants);
  if (!json) return;
  std::set<int> seen;
  const JsonRef mappings = json.required("mappings").as_array();
  mappings.each_element([&](std::size_t, const JsonRef& element) {
    const JsonRef mapping = element.as_object();
    if (!mapping) return;
    check_common(mapping);
    (void)mapping.required("material").as_index(sizes.materials, "material");
    const JsonRef variants = mapping.required("variants").as_array();
    variants.each_element([&](std::size_t, const JsonRef& variant) {
      const int index = variant.as_index(sizes.variants, "variant");
      if (index >= 0 && !seen.insert(index).second) {
        variant.invalid("DUPLICATE_ELEMENTS",
                        fmt::format("variant {} is mapped twice by this primitive", index));
      }
    });
  });
}

}  // namespace

void check_variants(const JsonRef& root, const Sizes& sizes) {
  const JsonRef extensions = root.member("extensions");
  const JsonRef json = extensions.member(kVariants);
  if (json) {
    const JsonRef variants = json.required("variants").as_array();
    variants.each_element([](std::size_t, const JsonRef& element) {
      const JsonRef variant = element.as_object();
      if (!variant) return;
      check_common(variant);
      (void)variant.required("name").as_string();
    });
  }
  each_object(root, "meshes", [&](const JsonRef& mesh) {
    const JsonRef primitives = mesh.member("primitives");
    primitives.each_element(
        [&](std::size_t, const JsonRef& primitive) { check_mappings(primitive, sizes); });
  });
}

}  // namespace octrace::gltf
