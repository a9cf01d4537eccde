// The CPU's own nodes against brute force: one ray, streams and packets give the same bits, for
// every builder and every instruction set that has a body of its own.
#include "backend/octree/wide.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "kernels/cpu/intersect.h"
#include "tests/support/brute_force.h"
#include "tests/support/intensity.h"
#include "tests/support/meshes.h"

namespace octrace::tests {
namespace {

using kernels::Hit;
using kernels::Ray;
using octree::Builder;

bool same_bits(const Hit& a, const Hit& b) {
  return a.triangle == b.triangle &&
         (!a.valid() || (std::bit_cast<std::uint32_t>(a.t) == std::bit_cast<std::uint32_t>(b.t) &&
                         std::bit_cast<std::uint32_t>(a.u) == std::bit_cast<std::uint32_t>(b.u) &&
                         std::bit_cast<std::uint32_t>(a.v) == std::bit_cast<std::uint32_t>(b.v)));
}

std::string describe(const Ray& ray, const Hit& expected, const Hit& found) {
  char text[512];
  std::snprintf(text, sizeof text,
                "ray o=(%a %a %a) d=(%a %a %a) t=[%a %a]: brute force %u t=%a u=%a v=%a, found %u "
                "t=%a u=%a v=%a",
                ray.origin.x, ray.origin.y, ray.origin.z, ray.direction.x, ray.direction.y,
                ray.direction.z, ray.tmin, ray.tmax, expected.triangle, expected.t, expected.u,
                expected.v, found.triangle, found.t, found.u, found.v);
  return text;
}

// Long thin triangles across each other: the builders cut them.
Mesh make_sticks(std::uint32_t count) {
  Mesh mesh{"sticks", {}, {}};
  std::mt19937_64 random(seed());
  std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
  const auto point = [&] { return kernels::Vec3(unit(random), unit(random), unit(random)); };
  for (std::uint32_t i = 0; i < count; ++i) {
    const kernels::Vec3 a = point(), b = point();
    mesh.positions.insert(mesh.positions.end(), {a, b, b + 0.1f * point()});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

std::vector<Mesh> wide_meshes() {
  std::vector<Mesh> meshes = hard_meshes();
  meshes.push_back(make_sticks(400));
  return meshes;
}

struct Wide : testing::TestWithParam<std::size_t> {
  Mesh mesh = wide_meshes()[GetParam()];

  octree::Octree build(Builder builder) const {
    octree::BuildOptions options;
    options.builder = builder;
    util::Result<octree::Octree> octree = octree::build(mesh.input(), options);
    EXPECT_TRUE(octree);
    return std::move(*octree);
  }

  // Random rays; with `spread` > 0 every `bundle` in a row lie around the first.
  std::vector<Ray> make_rays(const octree::Octree& octree, std::mt19937_64& random,
                             std::size_t count, float spread, std::size_t bundle) const {
    std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
      if (spread == 0.0f || i % bundle == 0) {
        rays.push_back(random_ray(mesh, octree, random));
        continue;
      }
      Ray ray = rays[i - i % bundle];
      for (int axis = 0; axis < 3; ++axis) {
        ray.direction[axis] *= 1.0f + spread * unit(random);
        if (random() % 4 == 0) ray.origin[axis] *= 1.0f + spread * unit(random);
      }
      if (random() % 8 == 0) ray.tmax *= 0.5f;
      rays.push_back(ray);
    }
    return rays;
  }

  // Every hundred in a row start close together and go anywhere, as rays for ambient occlusion do.
  std::vector<Ray> make_fans(const octree::Octree& octree, std::mt19937_64& random,
                             std::size_t count) const {
    std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
      rays.push_back(random_ray(mesh, octree, random));
      if (i % 100 == 0) continue;
      Ray& ray = rays[i];
      const kernels::Vec3 target = ray.origin + ray.direction;
      for (int axis = 0; axis < 3; ++axis) {
        ray.origin[axis] = rays[i - i % 100].origin[axis] * (1.0f + 1e-3f * unit(random));
      }
      ray.direction = target - ray.origin;
    }
    return rays;
  }

  void check(const octree::Octree& octree, const std::vector<Ray>& rays) const {
    const octree::WideOctree wide = octree::make_wide(octree.view());
    ASSERT_FALSE(wide.view().empty());
    kernels::SceneView view;
    view.octree = octree.view();
    const kernels::CpuTracer tracer(wide.view());
    const auto count = static_cast<std::uint32_t>(rays.size());
    std::vector<Hit> stream(count), packets(count);
    std::vector<float> transmittances(count, -1.0f);
    using kernels::TraceStatus;
    ASSERT_EQ(TraceStatus::ok, tracer.closest(view, {}, rays.data(), count, stream.data()));
    ASSERT_EQ(TraceStatus::ok,
              tracer.closest_coherent(view, {}, rays.data(), count, packets.data()));
    ASSERT_EQ(TraceStatus::ok,
              tracer.transmittance(view, {}, rays.data(), count, transmittances.data()));
    std::uint64_t hits = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Hit expected = brute_force(mesh.positions, mesh.triangles, rays[i]);
      hits += expected.valid();
      Hit one;
      ASSERT_EQ(TraceStatus::ok, tracer.closest(view, {}, rays[i], &one));
      float transmittance = -1.0f;
      ASSERT_EQ(TraceStatus::ok, tracer.transmittance(view, {}, rays[i], &transmittance));
      const char* where = tracer.instruction_set();
      ASSERT_TRUE(same_bits(expected, one))
          << where << ", one: " << describe(rays[i], expected, one);
      ASSERT_TRUE(same_bits(expected, stream[i]))
          << where << ", stream: " << describe(rays[i], expected, stream[i]);
      ASSERT_TRUE(same_bits(expected, packets[i]))
          << where << ", packets: " << describe(rays[i], expected, packets[i]);
      ASSERT_EQ(expected.valid() ? 0.0f : 1.0f, transmittance) << where << ", ray " << i;
      ASSERT_EQ(expected.valid() ? 0.0f : 1.0f, transmittances[i]) << where << ", ray " << i;
    }
    EXPECT_GT(hits, count / 20) << mesh.name;
  }
};

TEST_P(Wide, HitsWhatBruteForceHits) {
  for (const std::int64_t target : {std::int64_t{HWY_AVX3}, std::int64_t{HWY_AVX2}}) {
    if ((hwy::SupportedTargets() & target) == 0) continue;
    hwy::SetSupportedTargetsForTest(target);
    for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
      const octree::Octree octree = build(builder);
      std::mt19937_64 random(seed() + GetParam() * 7919 + static_cast<std::uint64_t>(builder));
      for (const auto& [spread, bundle] :
           {std::pair{0.0f, 1u}, {0.05f, 16u}, {0.05f, 32u}, {1e-3f, 32u}}) {
        SCOPED_TRACE(testing::Message()
                     << mesh.name << ", seed " << seed() << ", spread " << spread);
        check(octree, make_rays(octree, random, scaled(20'000) + 5, spread, bundle));
      }
      SCOPED_TRACE(testing::Message() << mesh.name << ", seed " << seed() << ", fans");
      check(octree, make_fans(octree, random, scaled(20'000) + 5));
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// Boxes of the leaf slots that hold each triangle.
using Box = std::array<kernels::Vec3, 2>;
using Places = std::vector<std::vector<Box>>;

bool holds(const Box& outer, const Box& inner) {
  bool inside = true;
  for (int axis = 0; axis < 3; ++axis) {
    inside &= outer[0][axis] <= inner[0][axis] && inner[1][axis] <= outer[1][axis];
  }
  return inside;
}

Places places_of_triangles(const Mesh& mesh, const octree::WideOctree& wide) {
  Places places(mesh.triangles.size());
  std::vector<bool> taken(wide.units.size(), false);
  const auto take = [&](std::uint32_t unit, std::size_t units) {
    for (std::size_t i = unit; i < unit + units; ++i) {
      ASSERT_LT(i, taken.size());
      ASSERT_FALSE(taken[i]);
      taken[i] = true;
    }
  };
  const kernels::WideView view = wide.view();
  const auto visit = [&](const auto& self, std::uint32_t index) -> void {
    take(index, kernels::kNodeUnits);
    if (testing::Test::HasFatalFailure()) return;
    const kernels::WideNode& node = view.node(index);
    for (int slot = 0; slot < kernels::kChildren; ++slot) {
      if (node.planes[0][0][slot] > node.planes[0][1][slot]) continue;
      const kernels::WideRef ref = node.child[slot];
      if ((ref & kernels::kLeafRef) == 0) {
        self(self, ref);
        continue;
      }
      const std::uint32_t n = kernels::leaf_count(ref);
      take(ref & (kernels::kMaxWideUnits - 1),
           (n * kernels::kLeafRows * sizeof(float) + sizeof(kernels::WideUnit) - 1) /
               sizeof(kernels::WideUnit));
      if (testing::Test::HasFatalFailure()) return;
      const float* rows = view.leaf(ref);
      for (std::uint32_t i = 0; i < n; ++i) {
        std::uint32_t id;
        std::memcpy(&id, &rows[kernels::kRowTriangle * n + i], sizeof id);
        ASSERT_LT(id, places.size());
        const float reach = rows[kernels::kRowReach * n + i];
        Box box;
        const kernels::Triangle& t = mesh.triangles[id];
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
          const int a = static_cast<int>(axis);
          const float corners[3] = {mesh.positions[t.a][a], mesh.positions[t.b][a],
                                    mesh.positions[t.c][a]};
          for (std::uint32_t k = 0; k < 3; ++k) {
            EXPECT_EQ(corners[k], rows[(3 * k + axis) * n + i]);
            EXPECT_LE(std::abs(double{corners[k]} - double{corners[(k + 1) % 3]}), double{reach});
          }
          box[0][a] = node.planes[axis][0][slot];
          box[1][a] = node.planes[axis][1][slot];
        }
        places[id].push_back(box);
      }
    }
  };
  visit(visit, 0);
  return places;
}

// Calls visit(box, place) for every leaf triangle below the node, with what its slot and those
// above it have in common.
template <class Visit>
void visit_leaf_triangles(const octree::Octree& octree, std::uint32_t index, const Box& bounds,
                          const Visit& visit) {
  const kernels::Node& node = octree.nodes[index];
  std::uint32_t child = node.first_child;
  for (int slot = 0; slot < kernels::kChildren; ++slot) {
    if (node.meta[slot] == 0) continue;
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = std::ldexp(1.0, node.exponent[axis]);
      const auto plane = [&](std::uint8_t q) {
        return static_cast<float>(node.origin[axis] + q * scale);
      };
      box[0][axis] = std::max(bounds[0][axis], plane(node.lower[axis][slot]));
      box[1][axis] = std::min(bounds[1][axis], plane(node.upper[axis][slot]));
    }
    if ((node.inner_mask >> slot) & 1) {
      visit_leaf_triangles(octree, child++, box, visit);
      continue;
    }
    const std::uint32_t first = node.first_triangle + (node.meta[slot] & 31u);
    const int count = std::popcount(node.meta[slot] >> 5 & 7u);
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(count); ++i) visit(box, first + i);
  }
}

// A part of a cut triangle may stick out of the triangle's box by 2^-18 of its longest side, and
// the hits that are found there lie in no other part.
TEST_P(Wide, HoldsTheMarginsOfCutTriangles) {
  const octree::Octree octree = build(Builder::quality);
  const Places places = places_of_triangles(mesh, octree::make_wide(octree.view()));
  std::size_t cut = 0;
  const Box everywhere{kernels::Vec3(-1e30f), kernels::Vec3(1e30f)};
  visit_leaf_triangles(octree, 0, everywhere, [&](const Box& slot, std::size_t place) {
    const kernels::LeafTriangle& t = octree.triangles[place];
    if (places[t.triangle].size() < 2) return;
    ++cut;
    Box part;
    float side = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
      part[0][axis] = std::min({t.a[axis], t.b[axis], t.c[axis]});
      part[1][axis] = std::max({t.a[axis], t.b[axis], t.c[axis]});
      side = std::max(side, part[1][axis] - part[0][axis]);
    }
    for (int axis = 0; axis < 3; ++axis) {
      part[0][axis] = std::max(part[0][axis] - side * 0x1p-18f, slot[0][axis]);
      part[1][axis] = std::min(part[1][axis] + side * 0x1p-18f, slot[1][axis]);
    }
    EXPECT_TRUE(std::any_of(places[t.triangle].begin(), places[t.triangle].end(),
                            [&](const Box& box) { return holds(box, part); }))
        << "triangle " << t.triangle;
  });
  if (mesh.name == "sticks") {
    EXPECT_GT(cut, 100u);
  }
}

// Triangles that are cut lie in several leaves, and every point of them in the box of one; BLEND
// triangles, which dim a ray each time they are met, lie in one leaf.
TEST_P(Wide, HoldsAllOfEveryTriangle) {
  const std::vector<std::uint32_t> geometry(mesh.triangles.size(), 0);
  for (const Builder builder : {Builder::median, Builder::sah, Builder::quality}) {
    for (const std::uint32_t flags : {0u, kernels::kBlend}) {
      SCOPED_TRACE(testing::Message()
                   << mesh.name << ", builder " << static_cast<int>(builder) << ", " << flags);
      octree::BuildOptions options;
      options.builder = builder;
      const octree::Octree octree = std::move(
          *octree::build({mesh.positions, mesh.triangles, geometry, {&flags, 1}}, options));
      const Places places = places_of_triangles(mesh, octree::make_wide(octree.view()));
      std::size_t references = 0, outside = 0;
      for (std::size_t id = 0; id < places.size(); ++id) {
        references += places[id].size();
        ASSERT_FALSE(places[id].empty()) << id;
        if (flags != 0 || builder == Builder::median) {
          EXPECT_EQ(1u, places[id].size()) << id;
        }
        const kernels::Triangle& t = mesh.triangles[id];
        const kernels::Vec3 a = mesh.positions[t.a], b = mesh.positions[t.b],
                            c = mesh.positions[t.c];
        constexpr int kSteps = 8;
        for (int i = 0; i <= kSteps; ++i) {
          for (int j = 0; i + j <= kSteps; ++j) {
            kernels::Vec3 point;
            for (int axis = 0; axis < 3; ++axis) {
              point[axis] = static_cast<float>(
                  (double{a[axis]} * i + double{b[axis]} * j + double{c[axis]} * (kSteps - i - j)) /
                  kSteps);
            }
            outside += std::none_of(places[id].begin(), places[id].end(), [&](const Box& box) {
              return holds(box, {point, point});
            });
          }
        }
      }
      EXPECT_EQ(0u, outside);
      EXPECT_EQ(octree.triangles.size(), references);
      if (flags == 0 && builder == Builder::quality && mesh.name == "sticks") {
        EXPECT_GT(references, mesh.triangles.size());
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, Wide, testing::Range<std::size_t>(0, wide_meshes().size()));

TEST(WideOctree, IsEmptyOverNothingAndOverBrokenNodes) {
  EXPECT_TRUE(octree::make_wide({}).view().empty());
  const Mesh mesh = make_sphere(20, kernels::Vec3(0.0f), 1.0f);
  octree::Octree octree = std::move(*octree::build(mesh.input(), {}));
  ASSERT_FALSE(octree::make_wide(octree.view()).view().empty());
  octree::Octree cycle = octree, outside = octree, short_of = octree;
  cycle.nodes[0].first_child = 0;
  outside.nodes[0].first_child = 1u << 30;
  short_of.triangles.resize(octree.triangles.size() / 2);
  for (const octree::Octree& broken : {cycle, outside, short_of}) {
    EXPECT_TRUE(octree::make_wide(broken.view()).view().empty());
  }
}

}  // namespace
}  // namespace octrace::tests
