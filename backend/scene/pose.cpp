#include "backend/scene/pose.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace octrace::scene {

namespace {

glm::dvec3 vec3_or(const std::vector<double>& values, const glm::dvec3& otherwise) {
  return values.size() == 3 ? glm::dvec3(values[0], values[1], values[2]) : otherwise;
}

LocalTransform transform_of(const tinygltf::Node& node) {
  LocalTransform local;
  if (node.matrix.size() == 16) {
    local.has_matrix = true;
    for (int i = 0; i < 16; ++i) local.matrix[i / 4][i % 4] = node.matrix[i];
    return local;
  }
  local.translation = vec3_or(node.translation, glm::dvec3(0.0));
  local.scale = vec3_or(node.scale, glm::dvec3(1.0));
  if (node.rotation.size() == 4) {  // x y z w in the file
    local.rotation =
        glm::dquat(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
  }
  return local;
}

std::size_t target_count(const tinygltf::Mesh& mesh) {
  std::size_t count = 0;
  for (const auto& primitive : mesh.primitives) count = std::max(count, primitive.targets.size());
  return count;
}

}  // namespace

glm::dmat4 LocalTransform::evaluate() const {
  if (has_matrix) return matrix;
  double w = rotation.w, x = rotation.x, y = rotation.y, z = rotation.z;
  const double norm = std::sqrt(w * w + x * x + y * y + z * z);
  if (norm > 0.0) {
    w /= norm, x /= norm, y /= norm, z /= norm;
  } else {
    w = 1.0;
  }
  const glm::dvec3 column_x(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z),
                            2.0 * (x * z - w * y));
  const glm::dvec3 column_y(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z),
                            2.0 * (y * z + w * x));
  const glm::dvec3 column_z(2.0 * (x * z + w * y), 2.0 * (y * z - w * x),
                            1.0 - 2.0 * (x * x + y * y));
  return {glm::dvec4(column_x * scale.x, 0.0), glm::dvec4(column_y * scale.y, 0.0),
          glm::dvec4(column_z * scale.z, 0.0), glm::dvec4(translation, 1.0)};
}

Pose static_pose(const tinygltf::Model& model) {
  Pose pose;
  pose.nodes.reserve(model.nodes.size());
  pose.weights.resize(model.nodes.size());
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    const tinygltf::Node& node = model.nodes[i];
    pose.nodes.push_back(transform_of(node));
    if (node.mesh < 0) continue;
    const tinygltf::Mesh& mesh = model.meshes[node.mesh];
    pose.weights[i] = node.weights.empty() ? mesh.weights : node.weights;
    pose.weights[i].resize(target_count(mesh), 0.0);
  }
  return pose;
}

std::vector<glm::dmat4> world_matrices(const tinygltf::Model& model, const Pose& pose) {
  std::vector<bool> is_child(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const int child : node.children) is_child[child] = true;
  }
  std::vector<glm::dmat4> worlds(model.nodes.size(), glm::dmat4(1.0));
  // A list instead of recursion: hierarchies may be as deep as the file is long. Each child is
  // placed once; validation refuses nodes of two parents.
  std::vector<int> pending;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (is_child[i]) continue;
    worlds[i] = pose.nodes[i].evaluate();
    pending.push_back(static_cast<int>(i));
  }
  while (!pending.empty()) {
    const int parent = pending.back();
    pending.pop_back();
    for (const int child : model.nodes[parent].children) {
      if (!is_child[child]) continue;
      is_child[child] = false;
      worlds[child] = worlds[parent] * pose.nodes[child].evaluate();
      pending.push_back(child);
    }
  }
  return worlds;
}

std::vector<glm::dmat4> joint_matrices(const gltf::Document& document, int skin,
                                       const std::vector<glm::dmat4>& worlds) {
  const tinygltf::Skin& source = document.model.skins[skin];
  std::vector<float> inverse_binds;
  if (source.inverseBindMatrices >= 0) {
    inverse_binds = document.read_floats(source.inverseBindMatrices);
  }
  std::vector<glm::dmat4> joints;
  joints.reserve(source.joints.size());
  for (std::size_t j = 0; j < source.joints.size(); ++j) {
    glm::dmat4 inverse_bind(1.0);
    if ((j + 1) * 16 <= inverse_binds.size()) {
      for (std::size_t i = 0; i < 16; ++i) inverse_bind[i / 4][i % 4] = inverse_binds[16 * j + i];
    }
    joints.push_back(worlds[source.joints[j]] * inverse_bind);
  }
  return joints;
}

}  // namespace octrace::scene
