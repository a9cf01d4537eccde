// Octree figures as --stats and `info --json` give them.
#pragma once

#include <nlohmann/json.hpp>

#include "backend/octree/octree.h"

namespace octrace::app {

inline nlohmann::ordered_json octree_json(const octree::Statistics& statistics) {
  return {{"nodes", statistics.nodes},
          {"leaves", statistics.leaves},
          {"triangles", statistics.triangles},
          {"depth", statistics.depth},
          {"bytes", statistics.bytes},
          {"children_per_node", statistics.children_per_node},
          {"triangles_per_leaf", statistics.triangles_per_leaf},
          {"sah_cost", statistics.sah_cost}};
}

}  // namespace octrace::app
