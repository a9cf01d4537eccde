// A primitive's vertices, and what morph targets and skins do to them.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "backend/gltf/document.h"
#include "backend/util/result.h"

namespace octrace::scene {

// In the mesh's own space, in double so that positions are rounded only once, in the world. Empty
// where the primitive has no such attribute.
struct Vertices {
  std::vector<glm::dvec3> positions;
  std::vector<glm::dvec3> normals;
  std::vector<glm::dvec4> tangents;
  std::array<std::vector<glm::dvec2>, 2> uvs;
  std::vector<glm::dvec4> colors;
};

// What to read beside positions.
struct VertexParts {
  bool directions = true;  // normals and tangents
  bool plain = true;       // texture coordinates and colours
};
Vertices read_vertices(const gltf::Document& document, const tinygltf::Primitive& primitive,
                       const VertexParts& parts = {});

// Adds weight times each morph target's differences, to what has been read. Normals and tangents
// are left to be normalised by whoever moves them to the world.
void add_morph_targets(const gltf::Document& document, const tinygltf::Primitive& primitive,
                       std::span<const double> weights, Vertices& vertices);

// Every set of JOINTS_n and WEIGHTS_n, `sets` entries a vertex, of four joints each.
struct SkinBinding {
  std::vector<std::vector<std::uint32_t>> joints;  // by set: 4 a vertex
  std::vector<std::vector<float>> weights;
  bool empty() const { return joints.empty(); }
};
SkinBinding read_skin_binding(const gltf::Document& document, const tinygltf::Primitive& primitive);

// The joints' matrices blended by a vertex's weights, which are brought to the sum of 1 that the
// specification asks for; a vertex without any weight follows its first joint.
glm::dmat4 blend_joints(const SkinBinding& binding, std::span<const glm::dmat4> joints,
                        std::size_t vertex);

// The directions of normals and tangents under a matrix.
class DirectionTransform {
 public:
  explicit DirectionTransform(const glm::dmat4& matrix);
  bool mirrors() const { return mirrors_; }
  // By the inverse transpose, unit. A matrix that flattens space is followed to its limit; where
  // even that leaves no direction, +Y.
  glm::dvec3 normal(const glm::dvec3& normal) const;
  // By the matrix itself, unit; handedness w turns over under a mirror.
  glm::dvec4 tangent(const glm::dvec4& tangent) const;

 private:
  glm::dmat3 linear_, cofactor_;
  bool mirrors_ = false;
};

}  // namespace octrace::scene
