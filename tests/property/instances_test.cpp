// Two levels of octrees beside every triangle of every instance, bit for bit, and beside the same
// scene with a copy of the mesh for each instance.
#include "backend/scene/instances.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "backend/octree/octree.h"
#include "backend/octree/update.h"
#include "backend/render/renderer.h"
#include "backend/scene/animator.h"
#include "kernels/cpu/intersect.h"
#include "kernels/instance_surface.h"
#include "tests/support/instanced_scene.h"
#include "tests/support/intensity.h"

namespace octrace::tests {
namespace {

using kernels::Instance;
using kernels::InstancedHit;
using kernels::kNone;
using kernels::Ray;
using kernels::Vec3;
using scene::testing::GltfFile;
using scene::testing::json;

// What a test of every triangle of every instance finds. It shares with the product what its bits
// are made of: the move of the ray into the mesh's space, and the triangle test.
InstancedHit brute_force(const kernels::InstancedSceneView& view, const scene::Instancing& shown,
                         const Ray& ray) {
  const kernels::SlabRay slab_ray = kernels::make_slab_ray(ray);
  InstancedHit best{{ray.tmax, 0.0f, 0.0f, kNone}, kNone};
  const auto nearer = [&](float t) { return !best.valid() || t < best.t; };
  const kernels::TriangleRay world_ray = kernels::make_triangle_ray(ray.direction);
  kernels::TriangleHit hit;
  for (std::uint32_t i = 0; i < view.triangles.size; ++i) {
    const kernels::Triangle& t = view.triangles[i];
    if (kernels::intersect_triangle(slab_ray, world_ray, view.positions[t.a], view.positions[t.b],
                                    view.positions[t.c], ray.tmin, ray.tmax, false, &hit) &&
        nearer(hit.t)) {
      best = {{hit.t, hit.u, hit.v, i}, kNone};
    }
  }
  for (std::uint32_t k = 0; k < view.instances.size; ++k) {
    const Instance& instance = view.instances[k];
    const scene::MeshRange& range = shown.ranges[instance.mesh];
    const scene::Bounds box = scene::instance_box(instance, range.half_extent);
    kernels::MeshRay in_mesh;
    if (!kernels::enter_instance(instance, box.lower, box.upper, slab_ray, ray.direction, ray.tmin,
                                 ray.tmax, &in_mesh)) {
      continue;
    }
    const kernels::SlabRay mesh_slab = kernels::make_slab_ray(in_mesh.ray);
    const kernels::TriangleRay mesh_ray = kernels::make_triangle_ray(in_mesh.ray.direction);
    for (std::uint32_t i = 0; i < range.triangle_count; ++i) {
      const std::uint32_t id = range.first_triangle + i;
      const kernels::Triangle& t = view.meshes.triangles[id];
      const auto& p = view.meshes.positions;
      if (!kernels::intersect_triangle(mesh_slab, mesh_ray, p[t.a], p[t.b], p[t.c],
                                       in_mesh.ray.tmin, in_mesh.ray.tmax, false, &hit)) {
        continue;
      }
      const float t_world = kernels::add_rn(in_mesh.start, hit.t);
      if (t_world >= in_mesh.tmin && t_world <= in_mesh.tmax && nearer(t_world)) {
        best = {{t_world, hit.u, hit.v, id}, k};
      }
    }
  }
  return best;
}

bool same_bits(const InstancedHit& a, const InstancedHit& b) {
  const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x); };
  if (a.triangle != b.triangle || a.instance != b.instance) return false;
  return !a.valid() || (bits(a.t) == bits(b.t) && bits(a.u) == bits(b.u) && bits(a.v) == bits(b.v));
}

// From near and far, along axes, from inside of instances, towards corners of meshes.
class Rays {
 public:
  Rays(const kernels::InstancedSceneView& view, const scene::Bounds& bounds, std::uint64_t seed_of)
      : view_(view), centre_(0.5f * (bounds.lower + bounds.upper)), random_(seed_of) {
    size_ = glm::length(bounds.upper - bounds.lower);
  }
  // Of eight kinds, the last two at corners exactly.
  static constexpr unsigned kKinds = 8, kPlainKinds = 6;
  Ray next(unsigned kinds = kKinds) {
    const Vec3 target = corner();
    const auto kind = random_() % kinds;
    const float distance = size_ * (kind == 0 ? 1000.0f : kind < 3 ? 0.01f : 1.0f);
    Vec3 origin = centre_ + distance * Vec3(signed_unit(), signed_unit(), signed_unit());
    if (kind == 7) origin = corner();
    Ray ray{origin, 0.0f, target - origin, std::numeric_limits<float>::infinity()};
    if (kind == 6) {
      const int axis = static_cast<int>(random_() % 3);
      ray.direction = Vec3(0.0f);
      ray.direction[axis] = target[axis] < origin[axis] ? -1.0f : 1.0f;
      ray.origin = target;
      ray.origin[axis] = origin[axis];
    }
    if (kind == 4) ray.tmin = 0.7f;
    if (kind == 5) ray.tmax = 1.0f;
    if (kind == 3) ray.direction *= 1e-3f;
    return ray;
  }

 private:
  float signed_unit() { return std::uniform_real_distribution<float>(-1.0f, 1.0f)(random_); }
  Vec3 corner() {
    kernels::InstancedSurface surface;
    surface.instance = &view_.instances[random_() % view_.instances.size];
    const auto& positions = view_.meshes.positions;
    return world_position(surface, positions[random_() % positions.size]);
  }
  const kernels::InstancedSceneView& view_;
  Vec3 centre_;
  float size_;
  std::mt19937_64 random_;
};

struct Instances : testing::TestWithParam<InstanceShape> {};

TEST_P(Instances, HaveTheBitsOfEveryTriangleTested) {
  const std::uint64_t rays = scaled(4000);
  const scene::Scene scene = make_instanced_scene(GetParam(), 60, seed());
  ASSERT_TRUE(scene.instancing);
  ASSERT_EQ(scene.instancing->instances.size(), 60u);
  std::vector<octree::Octree> trees;
  std::vector<kernels::InstancedSceneView> views;
  for (const auto builder :
       {octree::Builder::sah, octree::Builder::median, octree::Builder::quality}) {
    octree::BuildOptions options;
    options.builder = builder;
    auto tree = octree::build(scene, options);
    ASSERT_TRUE(tree);
    EXPECT_TRUE(octree::verify(*tree, scene));
    trees.push_back(std::move(*tree));
  }
  for (const octree::Octree& tree : trees) views.push_back(octree::instanced_view(scene, tree));
  const kernels::InstancedSceneView& view = views.front();
  const kernels::CpuTracer tracer;
  kernels::RenderParams params;
  params.cull = 0;
  Rays source(view, scene.bounds, seed());
  std::uint64_t hits = 0;
  for (std::uint64_t i = 0; i < rays; ++i) {
    const Ray ray = source.next();
    const InstancedHit expected = brute_force(view, *scene.instancing, ray);
    hits += expected.instance != kNone;
    for (const auto& scene_view : views) {
      InstancedHit found;
      ASSERT_EQ(tracer.closest(scene_view, params, ray, &found), kernels::TraceStatus::ok);
      ASSERT_TRUE(same_bits(expected, found))
          << "seed " << seed() << ", ray " << i << ": t " << expected.t << " and " << found.t
          << ", instance " << expected.instance << " and " << found.instance << ", triangle "
          << expected.triangle << " and " << found.triangle;
      float light = -1.0f;
      ASSERT_EQ(tracer.transmittance(scene_view, params, ray, &light), kernels::TraceStatus::ok);
      ASSERT_EQ(light, expected.valid() ? 0.0f : 1.0f) << "seed " << seed() << ", ray " << i;
    }
  }
  EXPECT_GT(hits, rays / 8) << "hardly any ray met an instance";
}

// Rays are aimed at corners, where the two scenes' roundings may see different sides of an edge.
TEST_P(Instances, LookLikeCopies) {
  const std::uint64_t rays = scaled(20000);
  const scene::Scene scene = make_instanced_scene(GetParam(), 60, seed() + 1);
  const auto baked = scene::bake_instances(scene, {});
  ASSERT_TRUE(baked);
  ASSERT_EQ(baked->triangles.size(), scene.triangles.size() + scene.instancing->triangles);
  const auto tree = octree::build(scene, {}), flat_tree = octree::build(*baked, {});
  ASSERT_TRUE(tree && flat_tree);
  const auto view = octree::instanced_view(scene, *tree);
  kernels::SceneView flat = baked->view();
  flat.octree = flat_tree->view();
  const kernels::CpuTracer tracer;
  Rays source(view, scene.bounds, seed() + 1);
  std::uint64_t differing = 0, hits = 0;
  for (std::uint64_t i = 0; i < rays; ++i) {
    Ray ray = source.next(Rays::kPlainKinds);
    ray.direction += 1e-4f * Vec3(ray.direction.y, ray.direction.z, ray.direction.x);
    InstancedHit found;
    kernels::Hit expected;
    tracer.closest(view, {}, ray, &found);
    tracer.closest(flat, {}, ray, &expected);
    hits += expected.valid();
    const float scale = glm::length(ray.origin - scene.bounds.lower) / glm::length(ray.direction);
    const bool same =
        found.valid() == expected.valid() &&
        (!found.valid() || (object_of(view, found) == object_of(flat, expected) &&
                            std::abs(found.t - expected.t) <= 1e-5f * std::max(scale, expected.t)));
    differing += !same;
  }
  EXPECT_GT(hits, rays / 8);
  EXPECT_LE(differing, rays / 200) << "seed " << seed();
}

std::string shape_name(const testing::TestParamInfo<InstanceShape>& info) {
  return info.param.name;
}
INSTANTIATE_TEST_SUITE_P(Shapes, Instances, testing::ValuesIn(instance_shapes()), shape_name);

// Every plane of an image, beside that of the scene with copies. Mirrored ones among them: culling,
// normals and their sides would show it.
TEST(InstancedImage, IsThatOfCopies) {
  InstanceShape shape{"Mirrored"};
  shape.mirrors = true;
  const scene::Scene scene = make_instanced_scene(shape, 40, 7);
  const auto baked = scene::bake_instances(scene, {});
  ASSERT_TRUE(baked);
  const auto tree = octree::build(scene, {}), flat_tree = octree::build(*baked, {});
  ASSERT_TRUE(tree && flat_tree);
  constexpr int kWidth = 160, kHeight = 120;
  const auto camera = scene::make_ray_camera(
      scene::frame_bounds(scene.bounds, double(kWidth) / kHeight), kWidth, kHeight);
  const auto aovs = render::parse_aovs("all");
  ASSERT_TRUE(aovs);
  render::Framebuffer found(kWidth, kHeight, *aovs), expected(kWidth, kHeight, *aovs);
  render::Settings settings;
  settings.params.spp = 4;
  ASSERT_TRUE(render::make_cpu_renderer(scene, *tree)->render(camera, settings, found));
  ASSERT_TRUE(render::make_cpu_renderer(*baked, *flat_tree)->render(camera, settings, expected));
  const auto& ids = expected.uints(render::Aov::object_id);
  std::size_t covered = 0, other_ids = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    covered += ids[i] > 3;  // ids 1 to 3 are the file's nodes
    other_ids += ids[i] != found.uints(render::Aov::object_id)[i];
  }
  EXPECT_GT(covered, ids.size() / 40);
  EXPECT_LE(other_ids, 4u);
  for (const render::AovInfo& info : render::aov_table()) {
    // Copies are other triangles, and mirrored ones count their corners the other way round.
    if (info.uint32 || info.aov == render::Aov::barycentric) continue;
    const auto a = found.floats(info.aov), b = expected.floats(info.aov);
    std::size_t differing = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (std::isinf(a[i]) && std::isinf(b[i])) continue;
      const double limit = info.aov == render::Aov::beauty ? 2e-2 : 1e-4;
      differing +=
          !(std::abs(double(a[i]) - b[i]) <= limit * std::max(1.0, std::abs(double(b[i]))));
    }
    EXPECT_LE(differing, a.size() / 200) << info.option;
  }
}

// A node that moves takes its instances along; the mesh and its octree stay.
TEST(InstancesInTime, AreThoseOfASceneMadeAtThatTime) {
  GltfFile file;
  json node = {{"mesh", file.mesh(bumpy_ball(0.0f, false))}};
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", file.floats("VEC3", {0, 0, 0, 5, 0, 0, 0, 3, 1})}};
  file.append("nodes", node);
  file.append("scenes", {{"nodes", json::array({0})}});
  const int times = file.floats("SCALAR", {0, 1});
  const int scales = file.floats("VEC3", {1, 1, 1, 2, -3, 4});
  file.append("animations",
              {{"samplers", json::array({{{"input", times}, {"output", scales}}})},
               {"channels",
                json::array({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "scale"}}}}})}});
  scene::Scene moving, anew;
  auto animator = scene::Animator::open(file.document(), {}, "", 0.0, moving);
  ASSERT_TRUE(animator) << animator.error().to_string();
  auto tree = octree::build(moving, {});
  ASSERT_TRUE(tree);
  const auto before = moving.instancing;
  const auto next = (*animator)->at(0.75, moving);
  ASSERT_TRUE(next);
  const auto changes = (*animator)->move_to(0.75, moving);
  ASSERT_TRUE(changes);
  EXPECT_TRUE(changes->instances);
  EXPECT_EQ(moving.instancing->meshes, before->meshes);
  octree::Upkeep upkeep;
  ASSERT_TRUE(octree::update(moving, {}, {}, *tree, upkeep));
  EXPECT_TRUE(octree::verify(*tree, moving));

  ASSERT_TRUE(scene::Animator::open(file.document(), {}, "", 0.75, anew));
  const auto bits = [](const scene::Instancing& instancing) {
    const auto* first = reinterpret_cast<const char*>(instancing.instances.data());
    return std::string(first, instancing.instances.size() * sizeof(Instance));
  };
  EXPECT_NE(bits(*moving.instancing), bits(*before));
  EXPECT_EQ(bits(*moving.instancing), bits(*anew.instancing));
  ASSERT_TRUE(next->instancing);
  EXPECT_EQ(bits(*next->instancing), bits(*anew.instancing));
  EXPECT_EQ(moving.bounds.lower, anew.bounds.lower);
  EXPECT_EQ(moving.bounds.upper, anew.bounds.upper);
}

// Two nodes of one instance each, of which the one is flat where the other is not.
TEST(InstancesInTime, OnesThatVanishMakeNoPairsAndWarnOnce) {
  GltfFile file;
  const int mesh = file.mesh(bumpy_ball(0.0f, false));
  const int places = file.floats("VEC3", {0, 0, 0});
  const int times = file.floats("SCALAR", {0, 1});
  json channels = json::array(), samplers = json::array();
  for (int i = 0; i < 2; ++i) {
    json node = {{"mesh", mesh}, {"translation", {3 * i, 0, 0}}};
    node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", places}};
    file.append("nodes", node);
    const float first = i == 0 ? 1.0f : 0.0f, last = 1.0f - first;
    const int scales = file.floats("VEC3", {first, 1, 1, last, 1, 1});
    samplers.push_back({{"input", times}, {"output", scales}, {"interpolation", "STEP"}});
    channels.push_back({{"sampler", i}, {"target", {{"node", i}, {"path", "scale"}}}});
  }
  file.append("scenes", {{"nodes", json::array({0, 1})}});
  file.append("animations", {{"samplers", samplers}, {"channels", channels}});
  scene::Scene scene;
  auto animator = scene::Animator::open(file.document(), {}, "", 0.0, scene);
  ASSERT_TRUE(animator) << animator.error().to_string();
  ASSERT_EQ(scene.instancing->instances.size(), 1u);
  EXPECT_EQ(scene.instancing->instances[0].object, 2u);
  EXPECT_EQ(scene.warnings.size(), 1u);
  const auto next = (*animator)->at(1.0, scene);
  ASSERT_TRUE(next);
  EXPECT_FALSE(next->instancing) << "an instance would move to where another one is";
  for (const double time : {1.0, 0.5, 1.5, 0.0}) {
    ASSERT_TRUE((*animator)->move_to(time, scene));
    EXPECT_EQ(scene.instancing->instances.size(), 1u);
    EXPECT_EQ(scene.warnings.size(), 1u);
  }
}

// What a million instances may cost: a tenth of that here, counted instead of measured.
TEST(InstancedMemory, IsCountedByTheInstance) {
  const int count = static_cast<int>(scaled(20000));
  const scene::Scene scene = make_instanced_scene({"Plain"}, count, seed());
  const auto tree = octree::build(scene, {});
  ASSERT_TRUE(tree);
  const double bytes = double(scene.bytes() + tree->instances.bytes()) / count;
  EXPECT_LT(bytes, 200.0);
  EXPECT_EQ(scene.instancing->triangles, 108u * static_cast<unsigned>(count));
}

}  // namespace
}  // namespace octrace::tests
