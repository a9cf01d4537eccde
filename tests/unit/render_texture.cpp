// Texture lookups against a reference in double precision, written from the definitions of OpenGL
// ES 3.0 (section 3.8.10) rather than from the kernel.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "kernels/texture.h"
#include "tests/unit/render_scene.h"

namespace octrace {
namespace {

using kernels::Filter;
using kernels::Vec2;
using kernels::Vec4;
using kernels::Wrap;

std::int64_t wrapped_index(std::int64_t i, std::int64_t n, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::min(std::max<std::int64_t>(i, 0), n - 1);
  if (wrap == Wrap::repeat) return ((i % n) + n) % n;
  const std::int64_t m = ((i % (2 * n)) + 2 * n) % (2 * n);
  return m < n ? m : 2 * n - 1 - m;
}

double decode(std::uint32_t texel, int channel, bool srgb) {
  const double c = ((texel >> (8 * channel)) & 0xff) / 255.0;
  if (!srgb || channel == 3) return c;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

double reference(const scene::Scene& scene, const kernels::Texture& texture, double u, double v,
                 int channel) {
  const auto fetch = [&](double x, double y) {
    const std::int64_t w = texture.width, h = texture.height;
    const auto column = wrapped_index(static_cast<std::int64_t>(x), w, texture.wrap_s);
    const auto row = wrapped_index(static_cast<std::int64_t>(y), h, texture.wrap_t);
    return decode(scene.texels[texture.first_texel + static_cast<std::size_t>(row * w + column)],
                  channel, texture.srgb != 0);
  };
  const double x = u * texture.width, y = v * texture.height;
  if (texture.filter == Filter::nearest) return fetch(std::floor(x), std::floor(y));
  const double x0 = std::floor(x - 0.5), y0 = std::floor(y - 0.5);
  const double fx = x - 0.5 - x0, fy = y - 0.5 - y0;
  return (1 - fy) * ((1 - fx) * fetch(x0, y0) + fx * fetch(x0 + 1, y0)) +
         fy * ((1 - fx) * fetch(x0, y0 + 1) + fx * fetch(x0 + 1, y0 + 1));
}

std::vector<std::uint32_t> noise(std::uint32_t count) {
  std::mt19937 random(7);
  std::vector<std::uint32_t> texels(count);
  for (auto& texel : texels) texel = random();
  return texels;
}

TEST(Texture, MatchesDoublePrecisionReference) {
  scene::Scene scene = test::empty_scene();
  const std::uint32_t width = 5, height = 8;
  for (const Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror})
    for (const Filter filter : {Filter::nearest, Filter::linear})
      for (const bool srgb : {false, true})
        test::add_texture(scene, width, height, noise(width * height), wrap, filter, srgb);
  const kernels::SceneView view = scene.view();
  std::mt19937 random(11);
  std::uniform_real_distribution<float> coordinate(-4.0f, 4.0f);
  int compared = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec2 uv(coordinate(random), coordinate(random));
    // Float rounds differently within 1e-5 of a texel's edge, where nearest jumps.
    const double x = uv.x * 5.0, y = uv.y * 8.0;
    const bool at_edge = std::abs(x - std::round(x)) < 1e-5 || std::abs(y - std::round(y)) < 1e-5;
    for (std::uint32_t t = 0; t < scene.textures.size(); ++t) {
      if (at_edge && scene.textures[t].filter == Filter::nearest) continue;
      const Vec4 value = kernels::sample_texture(view, t, uv);
      for (int c = 0; c < 4; ++c) {
        ASSERT_NEAR(value[c], reference(scene, scene.textures[t], uv.x, uv.y, c), 4e-6 * 8)
            << "texture " << t << " uv " << uv.x << " " << uv.y << " channel " << c;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 900000);
}

TEST(Texture, TexelCentresAreExact) {
  scene::Scene scene = test::empty_scene();
  const auto texels = noise(64);
  for (const Filter filter : {Filter::nearest, Filter::linear})
    test::add_texture(scene, 8, 8, texels, Wrap::repeat, filter, false);
  const kernels::SceneView view = scene.view();
  for (std::uint32_t t = 0; t < 2; ++t) {
    for (std::uint32_t i = 0; i < 64; ++i) {
      const Vec2 uv((static_cast<float>(i % 8) + 0.5f) / 8, (static_cast<float>(i / 8) + 0.5f) / 8);
      EXPECT_EQ(kernels::sample_texture(view, t, uv).x,
                static_cast<float>(texels[i] & 0xff) / 255.0f);
    }
  }
}

// With an address sanitizer a tap outside the image would be a report; without, the value shows it.
TEST(Texture, AnyCoordinateStaysInside) {
  scene::Scene scene = test::empty_scene();
  const std::vector<std::uint32_t> white(3, 0xffffffffu);
  for (const Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror})
    for (const Filter filter : {Filter::nearest, Filter::linear})
      test::add_texture(scene, 3, 1, white, wrap, filter, false);
  const kernels::SceneView view = scene.view();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float x : {0.0f, -0.0f, 1.0f, -1e-9f, 1e-45f, 0.99999994f, 8388607.5f, 1e10f, -1e10f,
                        3e38f, -3e38f, infinity, -infinity, std::nanf("")}) {
    for (std::uint32_t t = 0; t < scene.textures.size(); ++t) {
      EXPECT_EQ(kernels::sample_texture(view, t, {x, x}).x, 1.0f) << t << " at " << x;
      EXPECT_EQ(kernels::sample_texture(view, t, {0.5f, x}).w, 1.0f) << t << " at " << x;
    }
  }
}

TEST(Texture, TransformIsAppliedAsSpecified) {
  // KHR_texture_transform: offset (0.1, 0.2), rotation 90 degrees, scale (2, 3), as the extension's
  // matrices multiply: translation * rotation * scale, rotation being [cos sin; -sin cos].
  kernels::TextureRef ref;
  ref.transform_u = {0.0f, 3.0f, 0.1f};
  ref.transform_v = {-2.0f, 0.0f, 0.2f};
  const Vec2 moved = kernels::transform_uv(ref, {0.25f, 0.5f});
  EXPECT_FLOAT_EQ(moved.x, 1.6f);
  EXPECT_FLOAT_EQ(moved.y, -0.3f);
}

}  // namespace
}  // namespace octrace
