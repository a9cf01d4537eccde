// Instances of meshes: the meshes' own spaces, the matrices into and out of them, and boxes.
//
// How wide a box must be (u = 2^-24). M takes the mesh's space to the world, K is its inverse; the
// mesh lies within +-1, so its points stand within B_j = sum_r |M_jr| of the instance's centre
// along axis j. Let k = max_r sum_j |K_rj| B_j, the condition of M under scaling of axes (Skeel
// 1979). In the mesh's space, each along any axis:
// - rounding K, the products of the origin next to the box, and those of t times the direction over
//   twice B, leave a point off by 10 u k;
// - the triangle test clamps t into the triangle's box, which slab() widens by 2^-20 of the
// distance
//   from the origin, at most 2 k: 32 u k, and its own roundings 2 u k.
// Together 44 u k, so 64 u k B_j, plus what rounding M to float adds, holds every hit: a box that
// is 2^-18 k larger than its B. With k up to 2^14 that is at most a sixteenth, which changes the
// bound by less than is left.
#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "backend/gltf/instancing.h"
#include "backend/scene/instances.h"
#include "backend/scene/names.h"

namespace octrace::scene {

namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;

constexpr double kWorstCondition = 0x1p14;
constexpr double kBoxMargin = 0x1p-18;
// Metres: sizes between these keep a ray's direction in a mesh's space within kernels/instance.h's
// limits.
constexpr double kSmallest = 0x1p-40, kLargest = 0x1p31;

// Row r, column c of M.
double entry(const kernels::Instance& instance, int r, int c) { return instance.to_world[r][c]; }

dvec3 box_of_unit_mesh(const kernels::Instance& instance) {
  dvec3 box(0.0);
  for (int j = 0; j < 3; ++j) {
    for (int r = 0; r < 3; ++r) box[j] += std::abs(entry(instance, j, r));
  }
  return box;
}

// By rows r of K: sum_j |K_rj| B_j.
dvec3 conditions(const kernels::Instance& instance, const dvec3& box) {
  dvec3 sums(0.0);
  for (int r = 0; r < 3; ++r) {
    for (int j = 0; j < 3; ++j) sums[r] += std::abs(double{instance.to_mesh[r][j]}) * box[j];
  }
  return sums;
}

double largest(const dvec3& v) { return std::max({v.x, v.y, v.z}); }

// A mesh that is flat along an axis of its space looks the same whatever the matrix does to that
// axis, so a scale of 0 there, which has no inverse, becomes one that is like the others.
void thicken_flat_axis(dmat3& m, const kernels::Vec3& half_extent) {
  for (int axis = 0; axis < 3; ++axis) {
    if (half_extent[axis] != 0.0f) continue;
    const dvec3 a = m[(axis + 1) % 3], b = m[(axis + 2) % 3];
    const dvec3 across = glm::cross(a, b);
    const double area = glm::length(across);
    if (!(area > 0.0)) continue;
    const bool mirrors = glm::dot(across, m[axis]) < 0.0;
    m[axis] = across * ((mirrors ? -1.0 : 1.0) / std::sqrt(area));
  }
}

// False where the matrix is too flat or too small to be told from one without an inverse.
bool set_matrix(const dmat3& m, kernels::Instance& instance) {
  double size = 0.0;
  for (int i = 0; i < 9; ++i) {
    size = std::max(size, std::abs(m[i / 3][i % 3]));
  }
  if (!(size >= kSmallest && size <= kLargest)) return false;
  const dmat3 scaled = m / size;
  const dvec3 rows[3] = {glm::cross(scaled[1], scaled[2]), glm::cross(scaled[2], scaled[0]),
                         glm::cross(scaled[0], scaled[1])};
  const double determinant = glm::dot(scaled[0], rows[0]);
  if (determinant == 0.0) return false;
  for (int r = 0; r < 3; ++r) {
    for (int j = 0; j < 3; ++j) {
      instance.to_mesh[r][j] = static_cast<float>(rows[r][j] / determinant / size);
      instance.to_world[r][j] = static_cast<float>(m[j][r]);
    }
  }
  const dvec3 box = box_of_unit_mesh(instance);
  const dvec3 condition = conditions(instance, box);
  if (!(largest(condition) <= kWorstCondition)) return false;
  double reach = 0.0;
  for (int j = 0; j < 3; ++j) {
    double sum = 0.0;
    for (int r = 0; r < 3; ++r) sum += std::abs(entry(instance, j, r)) * condition[r];
    reach = std::max(reach, sum);
  }
  instance.reach = static_cast<float>(determinant < 0.0 ? -reach : reach);
  return true;
}

bool make_instance(const dmat4& to_world, const kernels::Vec3& half_extent,
                   kernels::Instance& instance) {
  for (int r = 0; r < 3; ++r) instance.to_mesh[r][3] = static_cast<float>(to_world[3][r]);
  dmat3 m(to_world);
  if (set_matrix(m, instance)) return true;
  thicken_flat_axis(m, half_extent);
  return set_matrix(m, instance);
}

// T * R * S of each instance of a node, by its accessors.
class LocalTransforms {
 public:
  LocalTransforms(const gltf::Document& document, int node) {
    const auto accessors = gltf::instance_accessors(document.model.nodes[node], document.model);
    if (accessors->translation >= 0) translations_ = document.read_floats(accessors->translation);
    if (accessors->rotation >= 0) rotations_ = document.read_floats(accessors->rotation);
    if (accessors->scale >= 0) scales_ = document.read_floats(accessors->scale);
  }
  dmat4 operator[](std::size_t i) const {
    LocalTransform local;
    if (!translations_.empty()) local.translation = vec3(translations_, i);
    if (!scales_.empty()) local.scale = vec3(scales_, i);
    if (!rotations_.empty()) {
      const float* q = &rotations_[4 * i];
      local.rotation = glm::dquat(q[3], q[0], q[1], q[2]);
    }
    return local.evaluate();
  }

 private:
  static dvec3 vec3(const std::vector<float>& values, std::size_t i) {
    return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  }
  std::vector<float> translations_, rotations_, scales_;
};

dmat4 from_mesh_space(const MeshSpace& space) {
  dmat4 matrix(space.scale);
  matrix[3] = glm::dvec4(space.centre, 1.0);
  return matrix;
}

// Moves the vertices of one mesh into a space of their own.
void normalise(Scene& scene, MeshRange& range) {
  MeshSpace& space = range.space;
  dvec3 lower(scene.positions[range.first_vertex]), upper = lower;
  const std::uint64_t end = std::uint64_t{range.first_vertex} + range.vertex_count;
  for (std::uint64_t v = range.first_vertex; v < end; ++v) {
    lower = glm::min(lower, dvec3(scene.positions[v]));
    upper = glm::max(upper, dvec3(scene.positions[v]));
  }
  space.centre = 0.5 * (lower + upper);
  const double half = 0.5 * largest(upper - lower);
  int exponent = 0;
  std::frexp(half, &exponent);
  if (half > 0.0) space.scale = std::ldexp(1.0, exponent);
  range.half_extent = kernels::Vec3(0.0f);
  for (std::uint64_t v = range.first_vertex; v < end; ++v) {
    kernels::Vec3& p = scene.positions[v];
    p = kernels::Vec3((dvec3(p) - space.centre) / space.scale);
    range.half_extent = glm::max(range.half_extent, glm::abs(p));
  }
}

float below(double x) {
  const auto f = static_cast<float>(x);
  return std::nextafter(f, -INFINITY);
}
float above(double x) { return -below(-x); }

bool is_finite(const dmat4& m) {
  for (int k = 0; k < 16; ++k) {
    if (!std::isfinite(m[k / 4][k % 4])) return false;
  }
  return true;
}

util::Error out_of_range(const gltf::Document& document, int node) {
  return {util::Exit::unsupported, "",
          fmt::format("places an instance beyond {:g} m or nowhere; positions must be finite and "
                      "within that",
                      kMaxCoordinate),
          document.file, fmt::format("/nodes/{}", node)};
}

bool fits(const Bounds& box) {
  for (int a = 0; a < 3; ++a) {
    if (!(box.lower[a] >= -kMaxCoordinate && box.upper[a] <= kMaxCoordinate)) return false;
  }
  return true;
}

util::Result<void> place_meshes(const gltf::Document& document, const InstancePlan& plan,
                                const Pose& pose, Instancing& result) {
  auto scene = std::make_shared<Scene>();
  const std::vector<dmat4> identities(document.model.nodes.size(), dmat4(1.0));
  Winding winding;
  if (auto ok = place_geometry(document, plan.meshes, pose, identities, *scene, winding); !ok) {
    return ok;
  }
  std::uint32_t g = 0;
  for (const int node : plan.mesh_nodes) {
    MeshRange range{};
    range.first_geometry = g;
    for (; g < scene->geometries.size(); ++g) {
      const kernels::Geometry& part = scene->geometries[g];
      if (part.object != static_cast<std::uint32_t>(node)) break;
      if (range.geometry_count++ == 0) {
        range.first_triangle = part.first_triangle;
        range.first_vertex = part.first_vertex;
      }
      range.triangle_count += part.triangle_count;
      range.vertex_count += part.vertex_count;
    }
    if (range.vertex_count != 0) normalise(*scene, range);
    result.ranges.push_back(range);
  }
  result.meshes = std::move(scene);
  return {};
}

// The instances of one node, behind those that are there.
util::Result<void> place_node(const gltf::Document& document,
                              const InstancePlan::NodeInstances& shown, const dmat4& world,
                              Instancing& result, std::vector<std::string>& warnings) {
  const MeshRange& range = result.ranges[shown.mesh];
  if (range.triangle_count == 0) return {};
  const LocalTransforms locals(document, shown.node);
  const dmat4 from_mesh = from_mesh_space(range.space);
  auto& instances = result.instances;
  const std::size_t first = instances.size();
  instances.resize(first + shown.count);
  std::atomic<bool> in_range{true};
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, shown.count, 4096), [&](const auto& part) {
    for (std::size_t i = part.begin(); i != part.end(); ++i) {
      kernels::Instance& instance = instances[first + i];
      instance.mesh = shown.mesh;
      instance.object = shown.first_object + static_cast<std::uint32_t>(i);
      const dmat4 to_world = world * locals[i] * from_mesh;
      if (!is_finite(to_world)) {
        in_range = false;
      } else if (!make_instance(to_world, range.half_extent, instance)) {
        instance.mesh = kernels::kNone;
      } else if (!fits(instance_box(instance, range.half_extent))) {
        in_range = false;
      }
    }
  });
  if (!in_range) return out_of_range(document, shown.node);
  const auto from = instances.begin() + static_cast<std::ptrdiff_t>(first);
  const auto kept = std::remove_if(from, instances.end(), [](const kernels::Instance& instance) {
    return instance.mesh == kernels::kNone;
  });
  const auto left_out = static_cast<std::uint64_t>(instances.end() - kept);
  instances.erase(kept, instances.end());
  if (left_out > 0) {
    warnings.push_back(fmt::format(
        "{} of {} instances of \"{}\" left out, because their transform makes them flat or too "
        "small to be seen",
        left_out, shown.count, printable(name_of(document.model.nodes, shown.node, "node"))));
  }
  result.triangles += std::uint64_t{range.triangle_count} * (shown.count - left_out);
  return {};
}

}  // namespace

std::uint64_t Instancing::bytes() const {
  return meshes->bytes() + ranges.size() * sizeof(MeshRange) +
         instances.size() * sizeof(kernels::Instance);
}

Bounds instance_box(const kernels::Instance& instance, const kernels::Vec3& half_extent) {
  const dvec3 unit = box_of_unit_mesh(instance);
  const double margin = kBoxMargin * largest(conditions(instance, unit));
  Bounds box;
  box.empty = false;
  for (int j = 0; j < 3; ++j) {
    double half = margin * unit[j];
    for (int r = 0; r < 3; ++r) half += std::abs(entry(instance, j, r)) * half_extent[r];
    box.lower[j] = below(instance.to_mesh[j][3] - half);
    box.upper[j] = above(instance.to_mesh[j][3] + half);
  }
  return box;
}

void add_instance_bounds(Scene& scene) {
  if (!scene.instancing) return;
  Bounds& bounds = scene.bounds;
  for (const kernels::Instance& instance : scene.instancing->instances) {
    const auto& half_extent = scene.instancing->ranges[instance.mesh].half_extent;
    const Bounds box = instance_box(instance, half_extent);
    bounds.lower = bounds.empty ? box.lower : glm::min(bounds.lower, box.lower);
    bounds.upper = bounds.empty ? box.upper : glm::max(bounds.upper, box.upper);
    bounds.empty = false;
  }
}

util::Result<void> place_instances(const gltf::Document& document, const InstancePlan& plan,
                                   const Pose& pose, const std::vector<dmat4>& worlds,
                                   bool same_meshes, Scene& scene) {
  if (plan.empty()) return {};
  auto result = std::make_shared<Instancing>();
  if (same_meshes && scene.instancing) {
    result->meshes = scene.instancing->meshes;
    result->ranges = scene.instancing->ranges;
  } else if (auto ok = place_meshes(document, plan, pose, *result); !ok) {
    return ok;
  }
  result->instances.reserve(plan.instances);
  for (const auto& shown : plan.nodes) {
    auto ok = place_node(document, shown, worlds[shown.node], *result, scene.warnings);
    if (!ok) return ok;
  }
  scene.instancing = std::move(result);
  add_instance_bounds(scene);
  return {};
}

}  // namespace octrace::scene
