// Every real scene, rendered, beside every triangle tested for every pixel: Z, mask and
// primitive_id are the same bits, culling and alpha cut-outs included.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <bit>
#include <cmath>
#include <limits>

#include "backend/render/renderer.h"
#include "kernels/alpha.h"
#include "kernels/triangle.h"
#include "tests/property/oracle_scenes.h"

namespace octrace::tests {
namespace {

using render::Aov;

struct Pixel {
  float z = std::numeric_limits<float>::infinity();
  std::uint32_t primitive_id = 0;
};

Pixel trace_all(const OracleScene& loaded, const kernels::Ray& ray) {
  const kernels::SceneView& view = loaded.view;
  const kernels::SlabRay slab_ray = kernels::make_slab_ray(ray);
  const kernels::TriangleRay triangle_ray = kernels::make_triangle_ray(ray.direction);
  Pixel best;
  for (std::uint32_t i = 0; i < view.triangles.size; ++i) {
    const kernels::Triangle& t = view.triangles[i];
    const std::uint32_t geometry = view.triangle_geometry[i];
    const kernels::Material& material = view.materials[view.geometries[geometry].material];
    kernels::TriangleHit hit;
    if (!kernels::intersect_triangle(slab_ray, triangle_ray, view.positions[t.a],
                                     view.positions[t.b], view.positions[t.c], ray.tmin, ray.tmax,
                                     material.double_sided == 0, &hit)) {
      continue;
    }
    if (!(hit.t < best.z)) continue;
    if (material.alpha_mode == kernels::AlphaMode::mask &&
        !kernels::alpha_passes(view, geometry, i, hit.u, hit.v)) {
      continue;
    }
    best = {hit.t, i + 1};
  }
  return best;
}

struct BruteForceScene : testing::TestWithParam<std::string> {};

TEST_P(BruteForceScene, HasTheSamePixels) {
  constexpr int kWidth = 64, kHeight = 48;
  const auto loaded = load_oracle_scene(GetParam(), double(kWidth) / kHeight);
  ASSERT_TRUE(loaded);
  const kernels::RayCamera camera = scene::make_ray_camera(loaded->camera, kWidth, kHeight);
  render::AovSet aovs;
  for (const Aov aov : {Aov::depth, Aov::mask, Aov::primitive_id})
    aovs.set(static_cast<std::size_t>(aov));
  render::Framebuffer image(kWidth, kHeight, aovs);
  ASSERT_TRUE(render::make_cpu_renderer(loaded->scene, loaded->octree)->render(camera, {}, image));
  std::vector<Pixel> expected(kWidth * kHeight);
  tbb::parallel_for(0, kHeight, [&](int y) {
    for (int x = 0; x < kWidth; ++x) {
      expected[y * kWidth + x] = trace_all(
          *loaded, camera_ray(camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
    }
  });
  for (int i = 0; i < kWidth * kHeight; ++i) {
    ASSERT_EQ(std::bit_cast<std::uint32_t>(expected[i].z),
              std::bit_cast<std::uint32_t>(image.floats(Aov::depth)[i]))
        << "pixel " << i % kWidth << ", " << i / kWidth;
    ASSERT_EQ(expected[i].primitive_id, image.uints(Aov::primitive_id)[i]);
    ASSERT_EQ(expected[i].primitive_id != 0 ? 1.0f : 0.0f, image.floats(Aov::mask)[i]);
  }
}

std::string file_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param.substr(info.param.find_last_of('/') + 1);
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(BruteForceScene);
INSTANTIATE_TEST_SUITE_P(Valid, BruteForceScene, testing::ValuesIn(oracle_scene_files()),
                         file_name);

}  // namespace
}  // namespace octrace::tests
