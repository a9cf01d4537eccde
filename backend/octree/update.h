// Keeps an octree true to a scene whose triangles move. The tree is refitted (same nodes, same
// order of triangles, new boxes) as long as that keeps it good, else built anew. Neither changes a
// bit of an image: ties in depth go to the lowest triangle index, whatever the tree.
#pragma once

#include "backend/octree/octree.h"

namespace octrace::octree {

struct UpdateOptions {
  // Build anew where the refitted tree's SAH cost, the expected tests of a random ray, is more than
  // this times that of the tree when it was built.
  double max_cost_growth = 1.3;
};

// What is remembered of an octree between updates.
struct Upkeep {
  double built_cost = 0.0;  // SAH cost when it was last built; 0: not known yet
  double cost = 0.0;        // now
  bool rebuilt = false;     // by the last update
};

// The octree of a scene whose triangles have other corners than when it was built, as many, in the
// same geometries. Returns the SAH cost. The octree must be sound (verify()).
double refit(const BuildInput& input, Octree& octree);
double refit(const scene::Scene& scene, Octree& octree);

// refit(), or build() where its cost has grown too much. Errors: build()'s.
util::Result<void> update(const scene::Scene& scene, const BuildOptions& build,
                          const UpdateOptions& options, Octree& octree, Upkeep& upkeep);

}  // namespace octrace::octree
