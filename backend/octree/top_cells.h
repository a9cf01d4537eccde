// The topmost splits of a scene of many triangles, chosen from what the cells of a grid hold: there
// is no pass over all references at each of them, which go through memory every time.
#pragma once

#include "backend/octree/top_tree.h"

namespace octrace::octree {

// Splits the root, whose count and room are known, into ranges that are few cells wide, or have no
// more triangles than a unit, or call for cuts; finds their bounds, of the centres only where a
// range is not split, and writes all references, in the order of the ranges. The same for any
// number of threads. False, and nothing done: of some of the triangles it seems that cuts are
// called for at once; the farthest centres are at no distance, or at one that is infinite or has no
// inverse; or the octree is to be of halves by rank.
bool split_by_cells(const BuildInput& input, const TopOptions& options, std::uint32_t unit,
                    TopRange& root, LooseReference* references);

}  // namespace octrace::octree
