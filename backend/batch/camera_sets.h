// Cameras that a job makes, rather than the scene's own.
#pragma once

#include <string>
#include <vector>

#include "backend/batch/job.h"
#include "backend/scene/scene.h"

namespace octrace::batch {

// n cameras called NAME_000 and so on; the same bits on every machine. `bounds` are the scene's at
// rest; an empty scene is a unit cube at the origin.
scene::Camera orbit_camera(const OrbitCameras& orbit, std::uint64_t index,
                           const scene::Bounds& bounds, double aspect);
std::string orbit_name(const OrbitCameras& orbit, std::uint64_t index);

// NAME_000: as many digits as the last of `count` needs, at least three.
std::string numbered(const std::string& name, std::uint64_t index, std::uint64_t count);

// The cameras of a nerfstudio transforms.json: camera to world, OpenGL axes, intrinsics for all or
// a frame's own. Exit 3 with the place; exit 4 for a camera model or distortion that is no pinhole.
// `image`: the size that is rendered, for files that give an angle and no size.
util::Result<std::vector<scene::Camera>> read_transforms(const std::string& path,
                                                         const ImageSize& image,
                                                         const util::Limits& limits);

// 16 numbers by columns, or 3 or 4 rows of 4; the last row is 0 0 0 1. Errors at the place.
util::Result<glm::dmat4> parse_matrix(const JsonAt& json);

}  // namespace octrace::batch
