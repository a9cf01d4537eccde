// The triangles of a glTF primitive (glTF 2.0, 3.7.2.1): lists, strips and fans, indexed or not.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/scene_types.h"

namespace octrace::scene {

bool has_triangles(int mode);  // TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN

// How many triangles `count` indices or vertices make; an incomplete last one does not count.
std::uint64_t triangle_count(int mode, std::uint64_t count);

// Corners in the specification's order: of strip triangle i (i, i + 1 + i % 2, i + 2 - i % 2), of
// fan triangle i (i + 1, i + 2, 0). An empty `indices` stands for 0, 1, 2, ... `vertices` - 1.
std::vector<kernels::Triangle> triangulate(int mode, std::span<const std::uint32_t> indices,
                                           std::uint32_t vertices);

}  // namespace octrace::scene
