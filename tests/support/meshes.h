// Triangle meshes that are hard on an octree, and rays that are hard on a traversal.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "backend/octree/octree.h"
#include "kernels/ray.h"
#include "kernels/scene_types.h"

namespace octrace::tests {

struct Mesh {
  std::string name;
  std::vector<kernels::Vec3> positions;
  std::vector<kernels::Triangle> triangles;

  octree::BuildInput input() const { return {positions, triangles, {}, {}}; }
};

// Sphere, soup, slivers, duplicates, coplanar grids, degenerate triangles, a fan with one huge hub,
// mixed scales, and copies 1e5 from the origin.
std::vector<Mesh> hard_meshes();
Mesh make_sphere(int rings, kernels::Vec3 centre, float radius);
Mesh make_grid(int n, float height, float size);

// Random rays towards the mesh; rays along axes, in the planes of the octree's boxes, through
// corners and edges, and starting on surfaces.
kernels::Ray random_ray(const Mesh& mesh, const octree::Octree& octree, std::mt19937_64& random);

}  // namespace octrace::tests
