#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

constexpr std::array<std::string_view, 3> kPlainSemantics{"POSITION", "NORMAL", "TANGENT"};
constexpr std::array<std::string_view, 4> kIndexedSemantics{"TEXCOORD", "COLOR", "JOINTS",
                                                            "WEIGHTS"};

// glTF 2.0, 3.7.2.1: known names, SET_n from 0 without gaps, and names of an application's own
// behind an underscore.
void check_attributes(const JsonRef& attributes, const Sizes& sizes) {
  std::map<std::string, std::size_t, std::less<>> counts;
  std::map<std::string, std::size_t, std::less<>> highest;
  attributes.each_member([&](std::string_view name, const JsonRef& accessor) {
    (void)accessor.as_index(sizes.accessors, "accessor");
    if (name.starts_with('_')) return;
    if (std::find(kPlainSemantics.begin(), kPlainSemantics.end(), name) != kPlainSemantics.end()) {
      return;
    }
    const auto line = name.rfind('_');
    const auto base = name.substr(0, line);
    const auto digits = line == std::string_view::npos ? std::string_view() : name.substr(line + 1);
    const bool indexed = std::find(kIndexedSemantics.begin(), kIndexedSemantics.end(), base) !=
                         kIndexedSemantics.end();
    const bool number = !digits.empty() && digits.size() <= 4 &&
                        digits.find_first_not_of("0123456789") == std::string_view::npos &&
                        (digits.size() == 1 || digits[0] != '0');
    if (!indexed || !number) {
      accessor.invalid("MESH_PRIMITIVE_INVALID_ATTRIBUTE",
                       fmt::format("{} is no attribute of glTF", quote(name)));
      return;
    }
    const std::size_t set = std::stoul(std::string(digits));
    ++counts[std::string(base)];
    highest[std::string(base)] = std::max(highest[std::string(base)], set);
  });
  for (const auto& [base, count] : counts) {
    if (highest[base] + 1 != count) {
      attributes.invalid(
          "MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY",
          fmt::format("needs {0}_0 to {0}_{1}, has {2} of them", base, highest[base], count));
    }
  }
  if (counts["JOINTS"] != counts["WEIGHTS"]) {
    attributes.invalid("MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH",
                       fmt::format("has {} sets of joints and {} of weights", counts["JOINTS"],
                                   counts["WEIGHTS"]));
  }
}

void check_targets(const JsonRef& targets, const JsonRef& attributes, const Sizes& sizes) {
  targets.as_array().each_element([&](std::size_t, const JsonRef& element) {
    const JsonRef target = element.as_object();
    if (target && target.json().empty()) target.invalid("EMPTY_ENTITY", "needs an attribute");
    target.each_member([&](std::string_view name, const JsonRef& accessor) {
      (void)accessor.as_index(sizes.accessors, "accessor");
      if (!attributes.member(name)) {
        accessor.invalid("MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR",
                         fmt::format("the primitive itself has no {}", quote(name)));
      }
    });
  });
}

void check_primitive(const JsonRef& primitive, const Sizes& sizes) {
  check_common(primitive);
  const JsonRef attributes = primitive.required("attributes").as_object();
  if (!attributes) return;
  if (attributes.json().empty()) attributes.invalid("EMPTY_ENTITY", "needs an attribute");
  check_attributes(attributes, sizes);
  (void)primitive.member("indices").as_index(sizes.accessors, "accessor");
  (void)primitive.member("material").as_index(sizes.materials, "material");
  (void)primitive.member("mode").as_integer(0, 6);
  const JsonRef targets = primitive.member("targets");
  check_targets(targets, attributes, sizes);
}

std::size_t target_count(const JsonRef& primitive) {
  const JsonRef targets = primitive.member("targets");
  return targets ? targets.json().size() : 0;
}

}  // namespace

void check_meshes(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "meshes", [&](const JsonRef& mesh) {
    check_common(mesh);
    const JsonRef primitives = mesh.required("primitives").as_array();
    primitives.each_element([&](std::size_t, const JsonRef& element) {
      const JsonRef primitive = element.as_object();
      if (primitive) check_primitive(primitive, sizes);
    });
    if (!primitives || mesh.issues().failed()) return;
    const JsonRef first = primitives.element(0);
    const std::size_t targets = target_count(first);
    primitives.each_element([&](std::size_t, const JsonRef& primitive) {
      if (target_count(primitive) != targets) {
        primitive.invalid("MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT",
                          fmt::format("has {} morph targets, the mesh's first primitive has {}",
                                      target_count(primitive), targets));
      }
    });
    const JsonRef weights = mesh.member("weights").as_array();
    if (weights && weights.json().size() != targets) {
      weights.invalid("MESH_INVALID_WEIGHTS_COUNT",
                      fmt::format("needs {} weights, has {}", targets, weights.json().size()));
    }
    weights.each_element([](std::size_t, const JsonRef& weight) { (void)weight.as_number(); });
  });
}

}  // namespace octrace::gltf
