// Every triangle against every ray: the oracle that has no tree. It shares the triangle test with
// the product on purpose (bits are compared); tests/property/embree_scenes_test.cpp checks that
// test with Embree.
#pragma once

#include <span>

#include "kernels/ray.h"
#include "kernels/scene_types.h"

namespace octrace::tests {

kernels::Hit brute_force(std::span<const kernels::Vec3> positions,
                         std::span<const kernels::Triangle> triangles, const kernels::Ray& ray);

}  // namespace octrace::tests
