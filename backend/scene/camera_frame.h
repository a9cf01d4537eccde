// The axes along which a camera sees, out of its matrix.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace octrace::scene {

struct CameraFrame {
  glm::dvec3 right, up, back, eye;  // orthonormal; left-handed where the matrix mirrors
};

// Gram-Schmidt from the viewing axis on, so that what the camera looks at never changes. A mirrored
// matrix keeps its mirrored image, as in a rasteriser; a degenerate one gets any perpendicular axis
// in place of a column that vanishes.
CameraFrame orthonormal_frame(const glm::dmat4& matrix);

}  // namespace octrace::scene
