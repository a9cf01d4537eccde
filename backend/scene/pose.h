// Where every node of a document stands and how far every morph target is blended in: all that an
// animation changes. Geometry is flattened from a pose, whichever way it came about.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "backend/gltf/document.h"

namespace octrace::scene {

// A node's own transform, relative to its parent: a matrix, or translation * rotation * scale.
struct LocalTransform {
  bool has_matrix = false;
  glm::dmat4 matrix{1.0};
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};  // w x y z; normalised when it is used
  glm::dvec3 scale{1.0};

  glm::dmat4 evaluate() const;
};

struct Pose {
  std::vector<LocalTransform> nodes;
  std::vector<std::vector<double>> weights;  // by node; as many as its mesh has morph targets
};

// As the file stands: the node's weights, else its mesh's, else 0.
Pose static_pose(const tinygltf::Model& model);

// Of every node, whether or not a scene names it, because a joint may lie outside of the scene.
std::vector<glm::dmat4> world_matrices(const tinygltf::Model& model, const Pose& pose);

// jointWorld * inverseBind of each joint, in the skin's order.
std::vector<glm::dmat4> joint_matrices(const gltf::Document& document, int skin,
                                       const std::vector<glm::dmat4>& worlds);

}  // namespace octrace::scene
