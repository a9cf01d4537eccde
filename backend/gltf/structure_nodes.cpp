// Nodes, scenes and skins, and that nodes form trees.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "backend/gltf/instancing.h"
#include "backend/gltf/structure.h"

namespace octrace::gltf {
namespace {

// An array of different node indices.
void check_node_list(const JsonRef& list, const Sizes& sizes) {
  const JsonRef array = list.as_array();
  std::vector<int> seen;
  array.each_element([&](std::size_t, const JsonRef& element) {
    seen.push_back(element.as_index(sizes.nodes, "node"));
  });
  if (list.issues().failed()) return;
  std::vector<int> sorted = seen;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice == sorted.end()) return;
  const auto first = std::find(seen.begin(), seen.end(), *twice);
  const auto second = std::find(first + 1, seen.end(), *twice);
  array.element(static_cast<std::size_t>(second - seen.begin()))
      .invalid("DUPLICATE_ELEMENTS", fmt::format("node {} is listed twice", *twice));
}

double number_at(const JsonRef& array, std::size_t i) {
  return array.element(i).as_number().value_or(0);
}

// Node rotations are used as rotations, so one that also scales would be a wrong image. Exporters
// that round to four digits stay well within this.
constexpr double kUnitTolerance = 1e-3;

void check_transform(const JsonRef& node) {
  const JsonRef matrix = node.member("matrix");
  if (matrix) {
    (void)matrix.as_numbers(16);
    if (node.member("translation") || node.member("rotation") || node.member("scale")) {
      matrix.invalid("NODE_MATRIX_TRS", "stands beside translation, rotation or scale");
    }
    if (node.issues().failed()) return;
    if (number_at(matrix, 3) != 0 || number_at(matrix, 7) != 0 || number_at(matrix, 11) != 0 ||
        number_at(matrix, 15) != 1) {
      matrix.invalid("NODE_MATRIX_NON_TRS", "the fourth row must be 0 0 0 1");
    }
  }
  for (const auto* key : {"translation", "scale"}) {
    const JsonRef value = node.member(key);
    if (value) (void)value.as_numbers(3);
  }
  const JsonRef rotation = node.member("rotation");
  if (!rotation || !rotation.as_numbers(4, -1, 1)) return;
  double squared = 0;
  for (std::size_t i = 0; i < 4; ++i) squared += number_at(rotation, i) * number_at(rotation, i);
  if (std::abs(std::sqrt(squared) - 1.0) > kUnitTolerance) {
    rotation.invalid("ROTATION_NON_UNIT",
                     fmt::format("needs length 1, has {}", std::sqrt(squared)));
  }
}

void check_node(const JsonRef& root, const JsonRef& node, const Sizes& sizes) {
  check_common(node);
  const JsonRef children = node.member("children");
  check_node_list(children, sizes);
  const int mesh = node.member("mesh").as_index(sizes.meshes, "mesh");
  (void)node.member("camera").as_index(sizes.cameras, "camera");
  (void)node.member("skin").as_index(sizes.skins, "skin");
  check_transform(node);
  check_instancing(node, sizes);
  const JsonRef extensions = node.member("extensions");
  const JsonRef punctual = extensions.member("KHR_lights_punctual");
  if (punctual) (void)punctual.required("light").as_index(sizes.lights, "light");
  const JsonRef visibility = extensions.member("KHR_node_visibility");
  (void)visibility.member("visible").as_boolean();
  for (const auto* key : {"weights", "skin"}) {
    const JsonRef dependent = node.member(key);
    if (dependent && !node.member("mesh")) {
      dependent.invalid("UNSATISFIED_DEPENDENCY", "needs mesh beside it");
    }
  }
  const JsonRef weights = node.member("weights").as_array();
  weights.each_element([](std::size_t, const JsonRef& weight) { (void)weight.as_number(); });
  if (!weights || mesh < 0 || node.issues().failed()) return;
  const Json& primitive = root.json()["meshes"][static_cast<std::size_t>(mesh)]["primitives"][0];
  const std::size_t targets = primitive.contains("targets") ? primitive["targets"].size() : 0;
  if (weights.json().size() != targets) {
    weights.invalid("NODE_WEIGHTS_INVALID",
                    fmt::format("needs {} weights, has {}", targets, weights.json().size()));
  }
}

}  // namespace

void check_nodes(const JsonRef& root, const Sizes& sizes) {
  each_object(root, "nodes", [&](const JsonRef& node) { check_node(root, node, sizes); });
  each_object(root, "scenes", [&](const JsonRef& scene) {
    check_common(scene);
    check_node_list(scene.member("nodes"), sizes);
  });
  each_object(root, "skins", [&](const JsonRef& skin) {
    check_common(skin);
    check_node_list(skin.required("joints"), sizes);
    (void)skin.member("inverseBindMatrices").as_index(sizes.accessors, "accessor");
    (void)skin.member("skeleton").as_index(sizes.nodes, "node");
  });
}

// Each node has at most one parent, so a walk towards the root either ends or is a loop. Nodes
// known to end are marked, which makes all walks together linear.
void check_hierarchy(const JsonRef& root) {
  const JsonRef nodes = root.member("nodes");
  if (!nodes) return;
  const std::size_t count = nodes.json().size();
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> parent(count, kNone);
  nodes.each_element([&](std::size_t i, const JsonRef& node) {
    const JsonRef children = node.member("children");
    children.each_element([&](std::size_t, const JsonRef& child) {
      const auto index = static_cast<std::size_t>(child.as_index(count, "node"));
      if (parent[index] != kNone) {
        child.invalid(
            "NODE_PARENT_OVERRIDE",
            fmt::format("node {} already has node {} as its parent", index, parent[index]));
      }
      parent[index] = i;
    });
  });
  if (root.issues().failed()) return;

  std::vector<std::size_t> visit(count, kNone);  // the walk that reached a node first
  for (std::size_t start = 0; start < count; ++start) {
    for (std::size_t i = start; i != kNone;) {
      if (visit[i] == start) {
        nodes.element(i).invalid("NODE_LOOP", fmt::format("node {} is its own ancestor", i));
        return;
      }
      if (visit[i] != kNone) break;
      visit[i] = start;
      i = parent[i];
    }
  }
  const JsonRef scenes = root.member("scenes");
  scenes.each_element([&](std::size_t, const JsonRef& scene) {
    const JsonRef roots = scene.member("nodes");
    roots.each_element([&](std::size_t, const JsonRef& node) {
      const auto index = static_cast<std::size_t>(node.as_index(count, "node"));
      if (parent[index] != kNone) {
        node.invalid("SCENE_NON_ROOT_NODE",
                     fmt::format("node {} is a child of node {}", index, parent[index]));
      }
    });
  });
}

}  // namespace octrace::gltf
