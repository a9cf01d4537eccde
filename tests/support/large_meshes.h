// Meshes of more than one unit (backend/octree/top_tree.h), those of hard_meshes() being smaller.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "tests/support/meshes.h"

namespace octrace::tests {

// From 0 to 1.
float uniform(std::mt19937_64& random);

using Corner = std::function<kernels::Vec3(std::uint32_t triangle, int corner, std::mt19937_64&)>;

// Triangles that share no corners.
Mesh make_mesh(const char* name, std::uint32_t count, const Corner& corner);
// Small triangles all over a cube of that size.
Mesh make_dust(std::uint32_t count, float scale = 1.0f);
// A flat disc of so many sectors among dust: re-insertion would make chains of such sectors.
Mesh make_disc_in_dust(std::uint32_t sectors);

// Made when it is asked for: every process of these tests goes through all names.
struct LargeMesh {
  std::string name;
  std::function<Mesh()> make;
};

// From 65 triangles on a scene has more than one unit, from 8193 on more than one subtree; from
// 65536 on its units have 1024 references (unit_size() in top_tree.cpp).
std::vector<LargeMesh> large_meshes();

}  // namespace octrace::tests
