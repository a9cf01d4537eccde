// Builds the octree over a scene's triangles.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "backend/octree/instance_levels.h"
#include "backend/scene/scene.h"
#include "backend/util/huge_vector.h"
#include "backend/util/result.h"
#include "kernels/node.h"

namespace octrace::octree {

enum class Builder { median, sah, quality };
const char* name_of(Builder builder);  // as --builder takes it

struct BuildOptions {
  Builder builder = Builder::sah;
  std::uint32_t leaf = 0;  // median: most vertices in a leaf (0: 8); else: most triangles (0: 3)
  unsigned threads = 0;    // 0: all
  std::uint64_t max_bytes = 64ull << 30;  // --max-scene-bytes
  // Triangles may be cut, so that they lie in several leaves. Of no use in a tree that is to be
  // refitted (update.h): there every leaf's box holds the whole of its triangles.
  bool cuts = true;
};

struct Statistics {
  std::uint64_t nodes = 0;
  std::uint64_t leaves = 0;     // child slots that hold triangles
  std::uint64_t triangles = 0;  // leaf triangles: those in several leaves count as often
  std::uint32_t depth = 0;      // nodes on the longest path from the root
  std::uint64_t bytes = 0;      // nodes and leaf triangles
  double children_per_node = 0.0;
  double triangles_per_leaf = 0.0;
  double sah_cost = 0.0;  // expected node and triangle tests of a random ray
};

struct Octree {
  util::HugeVector<kernels::Node> nodes;
  util::HugeVector<kernels::LeafTriangle> triangles;
  bool cut = false;          // more than a few triangles were cut and lie in several leaves
  InstanceLevels instances;  // empty where the scene has none

  kernels::OctreeView view() const {
    return {{nodes.data(), nodes.size()}, {triangles.data(), triangles.size()}, cut};
  }
};

// flags: kCullBack and so on of each triangle; the leaf triangle's geometry field comes from
// triangle_geometry. Both may be empty (0). Errors: exit 6 where max_bytes would be passed.
struct BuildInput {
  std::span<const kernels::Vec3> positions;
  std::span<const kernels::Triangle> triangles;
  std::span<const std::uint32_t> triangle_geometry;
  std::span<const std::uint32_t> flags;  // by geometry
};

// kCullBack and so on of each geometry, from its material.
std::vector<std::uint32_t> geometry_flags(const scene::Scene& scene);

util::Result<Octree> build(const BuildInput& input, const BuildOptions& options);
util::Result<Octree> build(const scene::Scene& scene, const BuildOptions& options);

// Checks every invariant: child boxes hold their triangles and their children's boxes, every
// triangle lies in a leaf, or all of it in several together; indices are in range, depth is within
// kMaxDepth. Exit 7.
util::Result<void> verify(const Octree& octree, const BuildInput& input);
util::Result<void> verify(const Octree& octree, const scene::Scene& scene);

Statistics statistics(const Octree& octree);

}  // namespace octrace::octree
