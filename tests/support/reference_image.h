// Images beside what tests/support/gltf_reference.h says of every one of their pixels.
#pragma once

#include <cstddef>
#include <vector>

#include "backend/render/framebuffer.h"
#include "tests/support/gltf_reference.h"

namespace octrace::tests {

// From in front, above and the right of what is to be seen: a camera's matrix.
Matrix reference_framing(const std::vector<ReferenceTriangle>& triangles, double yfov);

struct Tally {
  std::size_t hits = 0, undecided = 0, pixels = 0;
};

// Mask, depth, object and normal. Adds a fatal failure at the first pixel that differs.
void compare_with_reference(const GltfReference::Frame& frame, const Matrix& camera, double yfov,
                            const render::Framebuffer& image, Tally& tally);

}  // namespace octrace::tests
