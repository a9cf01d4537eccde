// octrace over a buffer of rays, timed.
#pragma once

#include <vector>

#include "backend/octree/octree.h"
#include "backend/octree/wide.h"
#include "backend/scene/scene.h"
#include "kernels/ray.h"

namespace octrace::bench {

// Seconds on `threads` CPU threads; hits are written where the pointer is not null. Any-hit queries
// set triangle to 0 where something was hit. Geometry only: no culling, no alpha.
double trace_cpu(const scene::Scene& scene, const octree::Octree& octree,
                 const octree::WideOctree& wide, const std::vector<kernels::Ray>& rays,
                 bool any_hit, bool coherent, unsigned threads, std::vector<kernels::Hit>* hits);

// What a ray costs in nodes and triangles tested, on average.
struct Work {
  double nodes = 0.0, triangles = 0.0;
};
Work count_work(const scene::Scene& scene, const octree::Octree& octree,
                const std::vector<kernels::Ray>& rays, bool any_hit);

}  // namespace octrace::bench
