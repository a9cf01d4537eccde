// Views from all over a scene. One camera may say little: what its rays meet may be a few triangles
// whose place in the tree is a matter of luck.
#pragma once

#include <vector>

#include "backend/scene/camera.h"
#include "tests/bench/octrace_tracer.h"

namespace octrace::bench {

// From in front of points of the surface, spread evenly over it, half way to what lies opposite and
// at most a tenth of the scene's diagonal away, towards other such points. The same for any tree.
// None where the scene has no surface.
std::vector<scene::Camera> scattered_views(const scene::Scene& scene, const octree::Octree& octree,
                                           const octree::WideOctree& wide, std::uint32_t count);

}  // namespace octrace::bench
