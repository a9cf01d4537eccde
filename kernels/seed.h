// The algorithm that this project grew from, as its paper has it, to be measured beside the
// product's: Wang, Ren, Zhao, Sun 2012, "Fast parallel algorithm of triangle intersection based on
// GPU", Physics Procedia 33. Nothing in the product uses it.
//
// The paper's steps and formulas:
// - an octree by median splits of the vertices in x, y and z, until a node has at most `threshold`
//   (8) of them; a leaf has the triangles of its vertices (tests/bench/seed_tree.h builds it);
// - a ray O + tD meets a box when, over the axes, the largest of the nearer plane distances
//   (plane - O) / D is no larger than the smallest of the farther ones;
// - it meets a triangle where O + tD = (1 - u - v) A + u B + v C with u >= 0, v >= 0, u + v <= 1:
//   three linear equations in t, u and v, solved by Cramer's rule;
// - one thread a pixel walks the tree with a stack, takes every child that is hit, in any order,
//   and keeps the nearest hit.
//
// How the product differs: eight quantised child boxes in one node (node.h), visited from near to
// far and left out beyond the nearest hit so far (traverse.h); boxes padded so that no rounding
// loses a hit (box.h); a watertight triangle test (triangle.h), where this one may leak between two
// triangles and has no fixed roundings of its own. Triangles are read by value, here by index.
#pragma once

#include "kernels/ray.h"
#include "kernels/scene_types.h"
#include "kernels/traverse.h"

namespace octrace::kernels {

inline constexpr std::uint32_t kSeedLeaf = 0x80000000u;

struct SeedNode {
  Vec3 lower;
  std::uint32_t first;  // leaf: into SeedView::ids; else the first child, the others follow it
  Vec3 upper;
  std::uint32_t count;  // of triangles, with kSeedLeaf set, or of children
};

struct SeedView {
  Span<SeedNode> nodes;  // the root is node 0
  Span<std::uint32_t> ids;
  Span<Triangle> triangles;
  Span<Vec3> positions;
};

// Every split is by rank, so 2^32 vertices have at most ceil(32 / 3) = 11 levels of nodes below the
// root, each of which leaves at most seven siblings on the stack.
inline constexpr int kSeedStack = 7 * 11 + 1;

OCTRACE_HD inline bool seed_meets_box(const Ray& ray, const Vec3& lower, const Vec3& upper) {
  float near = ray.tmin, far = ray.tmax;
  for (int axis = 0; axis < 3; ++axis) {
    const float o = ray.origin[axis], d = ray.direction[axis];
    if (d == 0.0f) {  // 0 / 0 is no distance
      if (o < lower[axis] || o > upper[axis]) return false;
      continue;
    }
    const float a = (lower[axis] - o) / d, b = (upper[axis] - o) / d;
    near = greater(near, lesser(a, b));
    far = lesser(far, greater(a, b));
  }
  return near <= far;
}

OCTRACE_HD inline Vec3 seed_cross(const Vec3& a, const Vec3& b) {
  return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

OCTRACE_HD inline float seed_dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

OCTRACE_HD inline bool seed_meets_triangle(const Ray& ray, const Vec3& a, const Vec3& b,
                                           const Vec3& c, float* t, float* u, float* v) {
  const Vec3 ab = b - a, ac = c - a, ao = ray.origin - a;
  const Vec3 p = seed_cross(ray.direction, ac), q = seed_cross(ao, ab);
  const float determinant = seed_dot(p, ab);
  if (determinant == 0.0f) return false;
  *u = seed_dot(p, ao) / determinant;
  *v = seed_dot(q, ray.direction) / determinant;
  *t = seed_dot(q, ac) / determinant;
  return *u >= 0.0f && *v >= 0.0f && *u + *v <= 1.0f && *t >= ray.tmin && *t <= ray.tmax;
}

// Of equally near triangles the one with the lowest index, so that the order of visits, which the
// paper leaves open, does not matter.
OCTRACE_HD inline void seed_test(const SeedView& scene, const Ray& ray, std::uint32_t id,
                                 Hit* nearest) {
  const Triangle triangle = scene.triangles[id];
  float t, u, v;
  if (!seed_meets_triangle(ray, scene.positions[triangle.a], scene.positions[triangle.b],
                           scene.positions[triangle.c], &t, &u, &v)) {
    return;
  }
  if (nearest->valid() && (t > nearest->t || (t == nearest->t && id > nearest->triangle))) return;
  *nearest = {t, u, v, id};
}

OCTRACE_HD inline TraceStatus seed_trace(const SeedView& scene, const Ray& ray, Hit* nearest) {
  *nearest = {ray.tmax, 0.0f, 0.0f, kNone};
  if (scene.nodes.empty()) return TraceStatus::ok;
  std::uint32_t stack[kSeedStack];
  int depth = 0;
  if (seed_meets_box(ray, scene.nodes[0].lower, scene.nodes[0].upper)) stack[depth++] = 0;
  while (depth > 0) {
    const SeedNode& node = scene.nodes[stack[--depth]];
    const std::uint32_t end = node.first + (node.count & ~kSeedLeaf);
    if (node.count & kSeedLeaf) {
      for (std::uint32_t i = node.first; i < end; ++i) seed_test(scene, ray, scene.ids[i], nearest);
      continue;
    }
    for (std::uint32_t i = node.first; i < end; ++i) {
      if (!seed_meets_box(ray, scene.nodes[i].lower, scene.nodes[i].upper)) continue;
      if (depth == kSeedStack) return TraceStatus::stack_overflow;
      stack[depth++] = i;
    }
  }
  return TraceStatus::ok;
}

}  // namespace octrace::kernels
