#include "backend/scene/deform.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

namespace octrace::scene {

namespace {

int components_of(const gltf::Document& document, int accessor) {
  return tinygltf::GetNumComponentsInType(
      static_cast<std::uint32_t>(document.model.accessors[accessor].type));
}

int find_attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto entry = attributes.find(name);
  return entry == attributes.end() ? -1 : entry->second;
}

// Adds scale times an attribute's values to vectors of at least as many components.
template <class Vector>
void accumulate(const gltf::Document& document, int accessor, double scale,
                std::vector<Vector>& values) {
  const std::vector<float> numbers = document.read_floats(accessor);
  const int components = components_of(document, accessor);
  const int used = std::min<int>(components, Vector::length());
  const std::size_t count = std::min(values.size(), numbers.size() / components);
  for (std::size_t v = 0; v < count; ++v) {
    for (int c = 0; c < used; ++c) values[v][c] += scale * numbers[v * components + c];
  }
}

template <class Vector>
std::vector<Vector> read(const gltf::Document& document, const tinygltf::Primitive& primitive,
                         const std::string& name, std::size_t count) {
  const int accessor = find_attribute(primitive.attributes, name);
  if (accessor < 0) return {};
  std::vector<Vector> values(count, Vector(0.0));
  accumulate(document, accessor, 1.0, values);
  return values;
}

glm::dvec3 unit_or(const glm::dvec3& v, const glm::dvec3& otherwise) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(largest > 0.0) || !std::isfinite(largest)) return otherwise;
  const glm::dvec3 scaled = v / largest;
  return scaled / std::sqrt(glm::dot(scaled, scaled));
}

}  // namespace

Vertices read_vertices(const gltf::Document& document, const tinygltf::Primitive& primitive,
                       const VertexParts& parts) {
  Vertices vertices;
  const int position = find_attribute(primitive.attributes, "POSITION");
  if (position < 0) return vertices;
  const std::size_t count = document.model.accessors[position].count;
  vertices.positions = read<glm::dvec3>(document, primitive, "POSITION", count);
  if (parts.directions) {
    vertices.normals = read<glm::dvec3>(document, primitive, "NORMAL", count);
    vertices.tangents = read<glm::dvec4>(document, primitive, "TANGENT", count);
  }
  if (!parts.plain) return vertices;
  vertices.uvs[0] = read<glm::dvec2>(document, primitive, "TEXCOORD_0", count);
  vertices.uvs[1] = read<glm::dvec2>(document, primitive, "TEXCOORD_1", count);
  vertices.colors = read<glm::dvec4>(document, primitive, "COLOR_0", count);
  const int color = find_attribute(primitive.attributes, "COLOR_0");
  if (color >= 0 && components_of(document, color) == 3) {
    for (glm::dvec4& c : vertices.colors) c.a = 1.0;
  }
  return vertices;
}

void add_morph_targets(const gltf::Document& document, const tinygltf::Primitive& primitive,
                       std::span<const double> weights, Vertices& vertices) {
  const std::size_t count = std::min(weights.size(), primitive.targets.size());
  for (std::size_t t = 0; t < count; ++t) {
    if (weights[t] == 0.0) continue;
    const auto add = [&](const char* name, auto& values) {
      const int accessor = find_attribute(primitive.targets[t], name);
      if (accessor >= 0 && !values.empty()) accumulate(document, accessor, weights[t], values);
    };
    add("POSITION", vertices.positions);
    add("NORMAL", vertices.normals);
    add("TANGENT", vertices.tangents);  // three components: handedness does not morph
    add("TEXCOORD_0", vertices.uvs[0]);
    add("TEXCOORD_1", vertices.uvs[1]);
    add("COLOR_0", vertices.colors);
  }
  // The specification has colours clamped after the sum.
  for (glm::dvec4& color : vertices.colors) {
    color = glm::clamp(color, glm::dvec4(0.0), glm::dvec4(1.0));
  }
}

SkinBinding read_skin_binding(const gltf::Document& document,
                              const tinygltf::Primitive& primitive) {
  SkinBinding binding;
  for (int set = 0;; ++set) {
    const int joints = find_attribute(primitive.attributes, fmt::format("JOINTS_{}", set));
    const int weights = find_attribute(primitive.attributes, fmt::format("WEIGHTS_{}", set));
    if (joints < 0 || weights < 0) return binding;
    binding.joints.push_back(document.read_uints(joints));
    binding.weights.push_back(document.read_floats(weights));
  }
}

glm::dmat4 blend_joints(const SkinBinding& binding, std::span<const glm::dmat4> joints,
                        std::size_t vertex) {
  glm::dmat4 blended(0.0);
  double total = 0.0;
  for (std::size_t set = 0; set < binding.joints.size(); ++set) {
    for (std::size_t k = 4 * vertex; k < 4 * vertex + 4; ++k) {
      const double weight = binding.weights[set][k];
      if (weight == 0.0) continue;
      blended += weight * joints[binding.joints[set][k]];
      total += weight;
    }
  }
  return total > 0.0 ? blended / total : joints[binding.joints[0][4 * vertex]];
}

DirectionTransform::DirectionTransform(const glm::dmat4& matrix) : linear_(matrix) {
  double largest = 0.0;
  for (int i = 0; i < 9; ++i) largest = std::max(largest, std::abs(linear_[i / 3][i % 3]));
  // Directions do not depend on the matrix's size, products of tiny or huge entries would.
  if (largest > 0.0 && std::isfinite(largest)) linear_ = linear_ / largest;
  cofactor_ = {glm::cross(linear_[1], linear_[2]), glm::cross(linear_[2], linear_[0]),
               glm::cross(linear_[0], linear_[1])};
  mirrors_ = glm::dot(linear_[0], cofactor_[0]) < 0.0;
  // The inverse transpose is the cofactor matrix over the determinant, of which only the sign
  // matters.
  if (mirrors_) cofactor_ = -cofactor_;
}

glm::dvec3 DirectionTransform::normal(const glm::dvec3& normal) const {
  return unit_or(cofactor_ * normal, glm::dvec3(0.0, 1.0, 0.0));
}

glm::dvec4 DirectionTransform::tangent(const glm::dvec4& tangent) const {
  const glm::dvec3 direction =
      unit_or(linear_ * glm::dvec3(tangent.x, tangent.y, tangent.z), glm::dvec3(1.0, 0.0, 0.0));
  return {direction, mirrors_ ? -tangent.w : tangent.w};
}

}  // namespace octrace::scene
