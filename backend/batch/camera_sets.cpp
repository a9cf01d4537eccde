#include "backend/batch/camera_sets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "backend/scene/exact_math.h"

namespace octrace::batch {

namespace {

using glm::dvec3;

// Towards the camera from its target.
dvec3 direction(const OrbitCameras& orbit, std::uint64_t index) {
  double turn = 0.0, height = 0.0, radius = 0.0;
  if (orbit.random) {
    // A band of a sphere has an area in proportion to its height (Archimedes).
    const auto stream = static_cast<std::uint32_t>(orbit.seed);
    const auto n = static_cast<std::uint32_t>(index);
    turn = scene::uniform(stream, 2 * n);
    height = scene::uniform(stream, 2 * n + 1);
    radius = std::sqrt(1.0 - height * height);
  } else {
    turn = orbit.start / 360.0 + static_cast<double>(index) / static_cast<double>(orbit.n);
    const scene::SinCos elevation = scene::sin_cos_turns(orbit.elevation / 360.0);
    height = elevation.sin;
    radius = elevation.cos;
  }
  const scene::SinCos azimuth = scene::sin_cos_turns(turn);
  return {radius * azimuth.sin, height, radius * azimuth.cos};
}

struct Sphere {
  dvec3 centre{0.0};
  double radius = std::sqrt(0.75);  // around a unit cube
};

Sphere bounding_sphere(const scene::Bounds& bounds) {
  Sphere sphere;
  if (bounds.empty) return sphere;
  const dvec3 lower(bounds.lower), upper(bounds.upper);
  sphere.centre = 0.5 * (lower + upper);
  const double radius = 0.5 * glm::length(upper - lower);
  // What float cannot tell from a point is shown as something around it.
  const double far =
      std::max({std::abs(sphere.centre.x), std::abs(sphere.centre.y), std::abs(sphere.centre.z)});
  sphere.radius = radius > 1e-5 * far ? radius : std::max(1e-5 * far, radius > 0.0 ? radius : 0.5);
  return sphere;
}

// camera to world, looking at the target; +Y up, or +Z down the screen where it looks along Y.
glm::dmat4 looking(const dvec3& eye, const dvec3& back) {
  const dvec3 helper = std::abs(back.y) < 1.0 - 1e-12 ? dvec3(0, 1, 0) : dvec3(0, 0, -back.y);
  const dvec3 right = glm::normalize(glm::cross(helper, back));
  return {{right, 0}, {glm::cross(back, right), 0}, {back, 0}, {eye, 1}};
}

}  // namespace

std::string numbered(const std::string& name, std::uint64_t index, std::uint64_t count) {
  const std::size_t digits = std::max<std::size_t>(3, std::to_string(count - 1).size());
  return fmt::format("{}_{:0{}}", name, index, digits);
}

std::string orbit_name(const OrbitCameras& orbit, std::uint64_t index) {
  return numbered(orbit.name, index, orbit.n);
}

scene::Camera orbit_camera(const OrbitCameras& orbit, std::uint64_t index,
                           const scene::Bounds& bounds, double aspect) {
  const Sphere sphere = bounding_sphere(bounds);
  const double half_fov = orbit.fov / 720.0;  // in turns
  const scene::SinCos half = scene::sin_cos_turns(half_fov);
  const double tan_y = half.sin / half.cos;
  // A sphere fits a cone where the distance is its radius over the sine of the half angle; the
  // narrower of the image's two angles counts.
  const double tan_least = tan_y * std::min(1.0, aspect);
  const double sine = tan_least / std::sqrt(1.0 + tan_least * tan_least);
  const double distance = orbit.distance.value_or(1.02 * sphere.radius / sine);
  const dvec3 back = glm::normalize(direction(orbit, index));
  scene::Camera camera;
  camera.name = orbit_name(orbit, index);
  camera.yfov = orbit.fov * 3.141592653589793 / 180.0;
  camera.matrix = looking(orbit.target.value_or(sphere.centre) + distance * back, back);
  return camera;
}

}  // namespace octrace::batch
