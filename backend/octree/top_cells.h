// The topmost splits of a scene of many triangles, chosen from what the cells of a grid hold: there
// is no pass over all references at each of them, which go through memory every time.
#pragma once

#include "backend/octree/top_tree.h"

namespace octrace::octree {

// Splits the root, whose count and room are known, as long as its ranges are many cells wide and no
// cuts are called for; finds its bounds and writes all references, in the order of the ranges. The
// same for any number of threads. False, and nothing done: of some of the triangles it seems that
// cuts are called for at once; or centres cannot be told apart, or are infinite.
bool split_by_cells(const BuildInput& input, const TopOptions& options, TopRange& root,
                    LooseReference* references);

}  // namespace octrace::octree
