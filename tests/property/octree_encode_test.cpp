// SIMD builds against plain texts: quantised boxes are those of kernels/quantise.h, slots those of
// a greedy search, and the whole octree is the same for every instruction set.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>

#include "backend/octree/octree.h"
#include "backend/octree/tree.h"
#include "kernels/quantise.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::kChildren;

// Calls body() with each instruction set of this machine in turn.
template <class Body>
void for_targets(const Body& body) {
  constexpr std::int64_t kTargets[] = {HWY_AVX3, HWY_AVX2, HWY_SSE4, HWY_SSSE3, HWY_SCALAR};
  for (const std::int64_t target : kTargets) {
    if (target != HWY_SCALAR && (hwy::SupportedTargets() & target) == 0) continue;
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body();
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
}

// Some far from the origin, some flat, some points, some on the planes of their frame.
std::array<octree::Child, kChildren> random_children(std::mt19937_64& random, std::size_t count) {
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::uniform_int_distribution<int> exponent(-30, 30), steps(0, 255);
  const float scale = std::ldexp(1.0f, exponent(random));
  const bool on_planes = random() % 4 == 0;
  float offset[3], step[3];
  for (int axis = 0; axis < 3; ++axis) {
    offset[axis] = random() % 2 == 0 ? 0.0f : std::ldexp(unit(random), exponent(random));
    step[axis] = random() % 8 == 0 ? 0.0f : scale * unit(random);
  }
  const auto corner = [&](int axis) {
    const float place = on_planes ? static_cast<float>(steps(random)) / 256.0f : unit(random);
    return offset[axis] + step[axis] * place;
  };
  std::array<octree::Child, kChildren> children;
  for (std::size_t c = 0; c < count; ++c) {
    octree::Float4 a{}, b{};
    for (int axis = 0; axis < 3; ++axis) {
      a[axis] = corner(axis);
      b[axis] = random() % 8 == 0 ? a[axis] : corner(axis);
    }
    children[c].box.add(a);
    children[c].box.add(b);
  }
  return children;
}

octree::Slots greedy_slots(std::span<const octree::Child> children, const octree::Box& parent) {
  const octree::Float4 centre = parent.centre2();
  octree::Slots slots{};
  std::array<bool, kChildren> child_done{}, slot_done{};
  for (std::size_t i = 0; i < children.size(); ++i) {
    float best = std::numeric_limits<float>::infinity();
    std::size_t best_child = 0, best_slot = 0;
    for (std::size_t c = 0; c < children.size(); ++c) {
      const octree::Float4 offset = children[c].box.centre2() - centre;
      for (std::size_t s = 0; s < kChildren; ++s) {
        if (child_done[c] || slot_done[s]) continue;
        float cost = s & 1 ? -offset[0] : offset[0];
        cost += s & 2 ? -offset[1] : offset[1];
        cost += s & 4 ? -offset[2] : offset[2];
        if (cost < best) {
          best = cost;
          best_child = c;
          best_slot = s;
        }
      }
    }
    slots[best_child] = static_cast<std::uint8_t>(best_slot);
    child_done[best_child] = slot_done[best_slot] = true;
  }
  return slots;
}

TEST(OctreeEncode, MatchesThePlainTexts) {
  for_targets([] {
    std::mt19937_64 random(seed());
    for (std::uint64_t i = 0; i < scaled(20000); ++i) {
      const std::size_t count = 1 + random() % kChildren;
      const auto children = random_children(random, count);
      const std::span<const octree::Child> used(children.data(), count);
      octree::Box bounds;
      for (const octree::Child& child : used) bounds.add(child.box);
      const octree::Slots slots = octree::slots_by_octant(used, bounds);
      kernels::Node node{};
      octree::quantise(used, slots, node);
      const octree::Slots expected = greedy_slots(used, bounds);
      for (std::size_t c = 0; c < count; ++c) {
        ASSERT_EQ(slots[c], expected[c]) << "seed " << seed() << ", case " << i << ", child " << c;
        for (int axis = 0; axis < 3; ++axis) {
          const double origin = bounds.lower[axis];
          const int exponent = kernels::exponent_for(origin, bounds.upper[axis]);
          const double scale = std::ldexp(1.0, exponent);
          ASSERT_EQ(node.exponent[axis], exponent);
          ASSERT_EQ(node.lower[axis][slots[c]],
                    kernels::step_below(origin, scale, children[c].box.lower[axis]))
              << "seed " << seed() << ", case " << i << ", child " << c << ", axis " << axis;
          ASSERT_EQ(node.upper[axis][slots[c]],
                    kernels::step_above(origin, scale, children[c].box.upper[axis]))
              << "seed " << seed() << ", case " << i << ", child " << c << ", axis " << axis;
        }
      }
    }
  });
}

struct OctreeTargets : testing::TestWithParam<std::size_t> {};

void expect_the_same_octree(const Mesh& mesh) {
  for (const octree::Builder builder : {octree::Builder::sah, octree::Builder::quality}) {
    octree::BuildOptions options;
    options.builder = builder;
    const util::Result<octree::Octree> expected = octree::build(mesh.input(), options);
    ASSERT_TRUE(expected);
    for_targets([&] {
      const util::Result<octree::Octree> found = octree::build(mesh.input(), options);
      ASSERT_TRUE(found);
      ASSERT_EQ(found->nodes.size(), expected->nodes.size());
      ASSERT_EQ(found->triangles.size(), expected->triangles.size());
      EXPECT_EQ(std::memcmp(found->nodes.data(), expected->nodes.data(),
                            found->nodes.size() * sizeof(kernels::Node)),
                0);
      EXPECT_EQ(std::memcmp(found->triangles.data(), expected->triangles.data(),
                            found->triangles.size() * sizeof(kernels::LeafTriangle)),
                0);
    });
  }
}

TEST_P(OctreeTargets, MakeTheSameOctree) { expect_the_same_octree(hard_meshes()[GetParam()]); }

TEST(OctreeSubtreeTargets, MakeTheSameOctreeOfSeveralSubtrees) {
  expect_the_same_octree(make_grid(70, 0.1f, 2.0f));
  expect_the_same_octree(make_sphere(120, kernels::Vec3(1.0f), 3.0f));
}

INSTANTIATE_TEST_SUITE_P(Meshes, OctreeTargets,
                         testing::Range<std::size_t>(0, hard_meshes().size()),
                         [](const auto& about) {
                           std::string name = hard_meshes()[about.param].name;
                           std::replace(name.begin(), name.end(), ' ', '_');
                           return name;
                         });

}  // namespace
}  // namespace octrace::tests
