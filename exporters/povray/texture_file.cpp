#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec4.hpp>

#include "exporters/png.h"
#include "exporters/povray/parts.h"

namespace octrace::exporters::povray {

namespace {

// A clamped texture is drawn out to cover the coordinates in use, up to this many pixels.
constexpr std::uint64_t kMaxDrawnPixels = 1ull << 26;

double linear_to_srgb(double v) {
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055;
}

std::uint32_t byte_of(double v) {
  return static_cast<std::uint32_t>(std::lround(std::clamp(v, 0.0, 1.0) * 255.0));
}

// Tiles of the image along one axis of texture coordinates.
struct Tiles {
  std::int64_t first = 0, count = 1;
};

Tiles tiles_of(kernels::Wrap wrap, double lowest, double highest) {
  if (wrap == kernels::Wrap::repeat) return {};
  if (wrap == kernels::Wrap::mirror) return {0, 2};
  const double first = std::clamp(std::floor(lowest), -64.0, 0.0);
  const double end = std::clamp(std::ceil(highest), 1.0, 64.0);
  return {static_cast<std::int64_t>(first), static_cast<std::int64_t>(end - first)};
}

std::uint32_t source_index(std::int64_t i, std::uint32_t size, kernels::Wrap wrap) {
  const std::int64_t n = size;
  if (wrap == kernels::Wrap::mirror) return static_cast<std::uint32_t>(i < n ? i : 2 * n - 1 - i);
  if (wrap == kernels::Wrap::clamp) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, n - 1));
  }
  return static_cast<std::uint32_t>(i);
}

struct UvRange {
  glm::dvec2 lower{0.0}, upper{1.0};
};

UvRange range_of(const scene::Scene& scene, std::uint32_t material,
                 const kernels::TextureRef& ref) {
  UvRange range;
  for (const kernels::Geometry& geometry : scene.geometries) {
    if (geometry.material != material) continue;
    for (std::uint32_t i = 0; i < geometry.vertex_count; ++i) {
      const glm::dvec2 uv = vertex_uv(scene, geometry, ref, geometry.first_vertex + i);
      range.lower = glm::min(range.lower, uv);
      range.upper = glm::max(range.upper, uv);
    }
  }
  return range;
}

}  // namespace

util::Result<ImageMap> write_image_map(Job& job, std::uint32_t material,
                                       const kernels::TextureRef& ref, const glm::dvec4& factor,
                                       MapUse use, const char* label) {
  const scene::Scene& scene = job.scene;
  const kernels::Texture& texture = scene.textures[ref.texture];
  const float* decode = scene.view().srgb_to_linear;
  const UvRange range = range_of(scene, material, ref);
  Tiles across = tiles_of(texture.wrap_s, range.lower.x, range.upper.x);
  Tiles down = tiles_of(texture.wrap_t, range.lower.y, range.upper.y);
  const std::uint64_t tile_pixels = std::uint64_t{texture.width} * texture.height;
  if (tile_pixels * static_cast<std::uint64_t>(across.count * down.count) > kMaxDrawnPixels) {
    across = down = {};
    job.note(
        fmt::format("texture {} is too large to be drawn out: it repeats instead of being "
                    "clamped or mirrored",
                    ref.texture));
  }

  const std::uint64_t width = texture.width * static_cast<std::uint64_t>(across.count);
  const std::uint64_t height = texture.height * static_cast<std::uint64_t>(down.count);
  std::vector<std::uint32_t> image(width * height);
  for (std::uint64_t y = 0; y < height; ++y) {
    const std::uint32_t row = source_index(
        static_cast<std::int64_t>(y) + down.first * texture.height, texture.height, texture.wrap_t);
    for (std::uint64_t x = 0; x < width; ++x) {
      const std::uint32_t column =
          source_index(static_cast<std::int64_t>(x) + across.first * texture.width, texture.width,
                       texture.wrap_s);
      const std::uint32_t texel =
          scene.texels[texture.first_texel + std::uint64_t{row} * texture.width + column];
      std::uint32_t pixel = byte_of((texel >> 24) / 255.0 * factor.w) << 24;
      for (int c = 0; c < 3; ++c) {
        const std::uint32_t stored = (texel >> (8 * c)) & 0xffu;
        const double linear = texture.srgb != 0 ? decode[stored] : stored / 255.0;
        pixel |= byte_of(linear_to_srgb(linear * factor[c])) << (8 * c);
      }
      image[y * width + x] = pixel;
    }
  }

  const std::string file = fmt::format("{}_{}_{}.png", job.path.safe_stem, label, material);
  const std::string path = job.path.folder + file;
  const auto written =
      write_png(path, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), image,
                use == MapUse::color_and_alpha ? 4 : 3);
  if (!written) return written.error();
  job.result.written.push_back(path);

  // glTF's second coordinate grows downwards, POV-Ray's image upwards.
  ImageMap map;
  map.pigment =
      fmt::format("image_map {{ png \"{}\" gamma srgb {} }} scale <{},{},1> translate <{},{},0>",
                  file, texture.filter == kernels::Filter::nearest ? "" : "interpolate 2",
                  across.count, -down.count, across.first, down.first + down.count);
  return map;
}

}  // namespace octrace::exporters::povray
