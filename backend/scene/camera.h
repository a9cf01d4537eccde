// A camera as users describe it, and the rays that it makes at an image size.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "backend/util/limits.h"
#include "backend/util/result.h"
#include "kernels/camera.h"

namespace octrace::scene {

enum class CameraType { perspective, orthographic, pinhole };

// Row 0 of the image is its top; a camera looks along its own -Z with +Y up. glTF's aspectRatio is
// ignored in favour of the image's own.
struct Camera {
  std::string name;
  CameraType type = CameraType::perspective;
  glm::dmat4 matrix{1.0};  // camera to world; scale is removed, as renderers do
  double yfov = 0.8;       // perspective: radians
  double xmag = 1.0,
         ymag = 1.0;  // orthographic: half of what the view spans; of xmag only the sign counts
  // pinhole: pixels, from the image's top left corner (the first pixel's centre is 0.5, 0.5), for
  // an image of width x height pixels; 0: for whatever size is rendered
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double width = 0, height = 0;
  double znear = 0.0;
  double zfar = std::numeric_limits<double>::infinity();
};

// Rays for an image of width x height pixels. Computed in double and rounded once. A mirrored
// matrix gives a mirrored image, a degenerate one some perpendicular axis; the viewing axis is
// kept.
kernels::RayCamera make_ray_camera(const Camera& camera, int width, int height);

// The file of --camera FILE.json: {"type": "perspective", "yfov": 0.7, "matrix": [16 numbers]},
// "orthographic" with xmag and ymag, or "pinhole" with fx fy cx cy (width and height optional);
// znear and zfar optional.
util::Result<Camera> read_camera_file(const std::string& path);

// A camera path: {"cameras": [...]} of what a camera file holds, or a camera file by itself. A
// camera without a name is called after the file, and its number where there are several.
util::Result<std::vector<Camera>> read_camera_path(const std::string& path,
                                                   const util::Limits& limits);

struct Bounds;
// A camera at eye that looks at target, +Y up; the two must not lie above each other.
Camera look_at(const glm::dvec3& eye, const glm::dvec3& target, double yfov);

// A camera that sees the whole bounds from the front, above and the right, from outside; where they
// are empty, one that frames a unit cube at the origin.
Camera frame_bounds(const Bounds& bounds, double aspect);

}  // namespace octrace::scene
