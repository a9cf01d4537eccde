// A second reading of animated and instanced glTF, written from the specification alone and sharing
// nothing with the product: its own JSON walk, accessors, samplers, matrices, skins, morph targets
// and rays, all in double precision. Slow and small; trusts its input.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace octrace::tests {

using Real3 = std::array<double, 3>;
using Matrix = std::array<double, 16>;  // by columns

struct ReferenceTriangle {
  std::array<Real3, 3> corners;
  std::array<Real3, 3> normals;  // world, unit; zero where the mesh has none
  bool double_sided;
  std::uint32_t node;  // object: instances count on from the nodes, in their nodes' order
};

struct ReferenceRay {
  Real3 origin, direction;  // direction: planar depth 1
  double tmin, tmax;
};

struct ReferenceHit {
  double depth;
  double facing;  // cosine between the ray and the triangle's normal, 0 edge-on
  Real3 normal;   // interpolated; zero where the mesh has none
  std::uint32_t node;
};

class GltfReference {
 public:
  explicit GltfReference(const std::string& path);

  const nlohmann::json& file() const { return json_; }
  // Key times of all samplers of an animation, ascending, without duplicates.
  std::vector<double> key_times(int animation) const;

  // The scene's triangles at a time of an animation (nothing: at rest).
  struct Frame {
    std::vector<ReferenceTriangle> triangles;
    std::vector<Matrix> worlds;     // by node
    std::vector<Matrix> instances;  // of EXT_mesh_gpu_instancing, to the world
  };
  Frame frame(int animation, std::optional<double> seconds) const;

 private:
  std::vector<double> accessor(int index) const;
  std::vector<double> raw(const nlohmann::json& where, int component, int components,
                          bool normalised, std::size_t count) const;
  std::vector<Matrix> instances(const nlohmann::json& attributes) const;
  void append_mesh(const nlohmann::json& node, const Matrix& world,
                   const std::vector<double>& morph, Frame& frame, std::uint32_t object) const;
  nlohmann::json json_;
  std::vector<std::string> buffers_;
};

// A perspective camera as docs/conventions.md has it.
ReferenceRay reference_ray(const Matrix& camera_to_world, double yfov, int width, int height,
                           double x, double y);

// The nearest triangle, with every triangle grown by `grow` in barycentric units (below 0: shrunk).
std::optional<ReferenceHit> reference_cast(const std::vector<ReferenceTriangle>& triangles,
                                           const ReferenceRay& ray, double grow);

}  // namespace octrace::tests
