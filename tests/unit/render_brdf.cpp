#include <gtest/gtest.h>

#include <random>

#include "kernels/brdf.h"
#include "tests/unit/reference_brdf.h"

namespace octrace {
namespace {

using kernels::Vec2;
using kernels::Vec3;
using test::ReferenceBrdf;

Vec3 to_float(const glm::dvec3& v) { return Vec3(v); }

glm::dvec3 random_direction(std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const double z = uniform(random) * 0.98 + 0.02, phi = 2 * std::numbers::pi * uniform(random);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

kernels::Brdf make(const ReferenceBrdf& brdf) {
  return kernels::make_brdf(Vec3(static_cast<float>(brdf.base)), static_cast<float>(brdf.metallic),
                            static_cast<float>(brdf.roughness));
}

const std::array<ReferenceBrdf, 8> kMaterials = {{{0.8, 0, 1.0},
                                                  {0.8, 0, 0.5},
                                                  {0.2, 0, 0.1},
                                                  {0.9, 1, 0.05},
                                                  {0.9, 1, 0.3},
                                                  {1.0, 1, 1.0},
                                                  {0.5, 0.5, 0.4},
                                                  {1.0, 0, 0.2}}};

TEST(Brdf, MatchesTextbookFormulas) {
  std::mt19937 random(3);
  for (const ReferenceBrdf& material : kMaterials) {
    const kernels::Brdf brdf = make(material);
    for (int i = 0; i < 5000; ++i) {
      const glm::dvec3 v = random_direction(random), l = random_direction(random);
      const double expected = material.evaluate(v, l);
      const Vec3 value = kernels::evaluate_brdf(brdf, {0, 0, 1}, to_float(v), to_float(l));
      ASSERT_NEAR(value.x, expected, 1e-4 * expected + 1e-7)
          << "roughness " << material.roughness << " metallic " << material.metallic;
      ASSERT_EQ(value.x, value.y);
    }
  }
}

TEST(Brdf, RotatesWithItsFrame) {
  std::mt19937 random(5);
  const ReferenceBrdf material{0.6, 0.3, 0.35};
  const kernels::Brdf brdf = make(material);
  for (int i = 0; i < 2000; ++i) {
    const glm::dvec3 v = random_direction(random), l = random_direction(random);
    const glm::dvec3 n = random_direction(random) * (i % 2 ? 1.0 : -1.0);
    const kernels::Basis basis = kernels::make_basis(to_float(n));
    EXPECT_NEAR(kernels::dot(basis.x, basis.y), 0, 1e-6);
    EXPECT_NEAR(kernels::dot(kernels::cross(basis.x, basis.y), basis.z), 1, 1e-6);
    const Vec3 value = kernels::evaluate_brdf(brdf, to_float(n), basis.to_world(to_float(v)),
                                              basis.to_world(to_float(l)));
    EXPECT_NEAR(value.x, material.evaluate(v, l), 2e-4 * material.evaluate(v, l) + 1e-6);
  }
}

TEST(Brdf, SamplingReproducesTheIntegrals) {
  const kernels::Basis basis = kernels::make_basis({0, 0, 1});
  constexpr std::uint32_t kCount = 65536;
  for (const ReferenceBrdf& material : kMaterials) {
    const kernels::Brdf brdf = make(material);
    for (const double cosine : {0.98, 0.7, 0.3, 0.1}) {
      const glm::dvec3 v(std::sqrt(1 - cosine * cosine), 0, cosine);
      ReferenceBrdf::Moments diffuse, specular;
      for (std::uint32_t i = 0; i < kCount; ++i) {
        const auto sampler = kernels::make_sampler(1, 2, 3, i, kCount);
        // The basis's own x axis: sampling may not depend on it.
        const Vec3 view = to_float(v);
        const auto d = kernels::sample_diffuse(brdf, basis, view, sampler.get2(0));
        diffuse.share += d.weight.x;
        diffuse.direction += double(d.weight.x) * glm::dvec3(d.direction);
        const auto s = kernels::sample_specular(brdf, basis, view, sampler.get2(1));
        specular.share += s.weight.x;
        specular.direction += double(s.weight.x) * glm::dvec3(s.direction);
      }
      const auto want_diffuse = material.diffuse_moments(v);
      const auto want_specular = material.specular_moments(v);
      EXPECT_NEAR(diffuse.share / kCount, want_diffuse.share, 1e-3);
      EXPECT_NEAR(specular.share / kCount, want_specular.share, 1.5e-3)
          << "roughness " << material.roughness << " cosine " << cosine;
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(diffuse.direction[c] / kCount, want_diffuse.direction[c], 2e-3);
        EXPECT_NEAR(specular.direction[c] / kCount, want_specular.direction[c], 1.5e-3);
      }
    }
  }
}

// Metals only: under a dielectric layer the specification's diffuse term is dimmed by the Fresnel
// term of the half vector, not by the layer's reflectance, and white reflects too much at grazing
// angles.
TEST(Brdf, MetalsNeverReflectMoreThanArrives) {
  for (double roughness = 0.05; roughness <= 1.0; roughness += 0.19) {
    for (const double cosine : {0.05, 0.3, 0.6, 0.99}) {
      EXPECT_LE((ReferenceBrdf{1.0, 1.0, roughness}.white_sky(cosine)), 1.0 + 1e-3);
    }
  }
  EXPECT_NEAR((ReferenceBrdf{1.0, 1.0, 0.05}.white_sky(0.7)), 1.0, 1e-3);
}

TEST(Brdf, ExtremesStayFinite) {
  for (const float roughness : {0.0f, 1e-30f, 1.0f, 7.0f}) {
    for (const float base : {0.0f, 1.0f, 50.0f}) {
      const kernels::Brdf brdf = kernels::make_brdf(Vec3(base), 0.5f, roughness);
      for (const float x : {0.0f, 1e-20f, 1e-4f, 0.5f, 0.999999f, 1.0f}) {
        const Vec3 v = kernels::normalize_or({x, 0, 1.0f - x}, {0, 0, 1});
        for (const Vec3 l : {v, -v, Vec3(-v.x, 0, v.z), Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(0.0f)}) {
          EXPECT_TRUE(kernels::is_finite(kernels::evaluate_brdf(brdf, {0, 0, 1}, v, l)));
        }
        for (const Vec2 u : {Vec2(0.0f), Vec2(0.5f), Vec2(0x1.fffffep-1f), Vec2(0, 0.5f)}) {
          const auto basis = kernels::make_basis({0, 0, -1});
          const auto s = kernels::sample_specular(brdf, basis, -v, u);
          EXPECT_TRUE(kernels::is_finite(s.direction) && kernels::is_finite(s.weight));
          const auto d = kernels::sample_diffuse(brdf, basis, -v, u);
          EXPECT_TRUE(kernels::is_finite(d.direction) && kernels::is_finite(d.weight));
        }
      }
    }
  }
}

TEST(Sampler, StrataAreFilledOnce) {
  for (const std::uint32_t count : {1u, 2u, 7u, 16u, 64u, 100u, 1024u}) {
    const auto columns = static_cast<std::uint32_t>(std::sqrt(double(count)));
    std::vector<int> one(count), y_strata(count), columns_hit(columns);
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto sampler = kernels::make_sampler(11, 4, 9, i, count);
      const float u = sampler.get1(5);
      const Vec2 p = sampler.get2(6);
      ASSERT_TRUE(u >= 0 && u < 1 && p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
      ++one[static_cast<std::size_t>(double(u) * count + 1e-6 * count * u)];
      ++y_strata[static_cast<std::size_t>(p.y * static_cast<float>(count))];
      ++columns_hit[static_cast<std::size_t>(p.x * static_cast<float>(columns))];
    }
    for (const int n : y_strata) EXPECT_EQ(n, 1) << count;
    for (const int n : columns_hit)
      EXPECT_NEAR(n, double(count) / columns, columns * columns == count ? 0 : 1.5 + columns);
    for (const int n : one) EXPECT_LE(n, 2) << count;
  }
}

TEST(Sampler, DifferentPixelsSeedsAndDimensionsDiffer) {
  const auto draw = [](std::uint32_t x, std::uint32_t y, std::uint32_t seed, std::uint32_t d) {
    return kernels::make_sampler(x, y, seed, 0, 16).get1(d);
  };
  const float base = draw(3, 4, 0, 0);
  EXPECT_EQ(base, draw(3, 4, 0, 0));
  EXPECT_NE(base, draw(4, 3, 0, 0));
  EXPECT_NE(base, draw(3, 4, 1, 0));
  EXPECT_NE(base, draw(3, 4, 0, 1));
  // Over many pixels one sample's mean is that of a uniform number.
  double sum = 0;
  for (std::uint32_t x = 0; x < 256; ++x)
    for (std::uint32_t y = 0; y < 256; ++y) sum += draw(x, y, 7, 3);
  EXPECT_NEAR(sum / 65536, 0.5, 0.005);
}

TEST(Sampler, DiskIsUniform) {
  const int n = 300;
  int inside = 0;
  double x2 = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const Vec2 p = kernels::sample_disk(
          {(static_cast<float>(i) + 0.5f) / n, (static_cast<float>(j) + 0.5f) / n});
      const double r2 = double(p.x) * p.x + double(p.y) * p.y;
      ASSERT_LE(r2, 1.0 + 1e-6);
      inside += r2 < 0.25;
      x2 += double(p.x) * p.x;
    }
  }
  EXPECT_NEAR(inside / double(n * n), 0.25, 0.005);
  EXPECT_NEAR(x2 / (n * n), 0.25, 0.001);
}

}  // namespace
}  // namespace octrace
