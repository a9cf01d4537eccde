// Texture lookups: nearest or bilinear taps of the full-size image. There are no mipmaps: beauty
// filters by its samples, and geometry AOVs and alpha tests are point samples by definition.
// Bit-identical on every device: IEEE + - * / and exact floor only; sRGB is decoded by table.
#pragma once

#include "kernels/scene_view.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

// The coordinate brought into [0, 1]. Huge values, whose fraction float does not hold, become 0,
// and so do infinities and NaN, so that the texel index that follows is always in range.
OCTRACE_HD inline float wrap_coordinate(float x, Wrap wrap) {
  float wrapped = x;
  if (wrap == Wrap::repeat) {
    wrapped = x - std::floor(x);
  } else if (wrap == Wrap::mirror) {
    wrapped = x - 2.0f * std::floor(x * 0.5f);
    if (wrapped > 1.0f) wrapped = 2.0f - wrapped;
  } else {
    wrapped = x < 0.0f ? 0.0f : (x > 1.0f ? 1.0f : x);
  }
  return wrapped >= 0.0f && wrapped <= 1.0f ? wrapped : 0.0f;
}

// A tap at most one texel outside of [0, size) brought inside. The mirror image of texel -1 is
// texel 0, so mirroring is clamping here.
OCTRACE_HD inline std::int32_t wrap_texel(std::int32_t i, std::int32_t size, Wrap wrap) {
  if (i < 0) return wrap == Wrap::repeat ? size - 1 : 0;
  if (i >= size) return wrap == Wrap::repeat ? 0 : size - 1;
  return i;
}

OCTRACE_HD inline Vec4 fetch_texel(const SceneView& scene, const Texture& texture, std::int32_t x,
                                   std::int32_t y) {
  const std::uint64_t index = texture.first_texel + static_cast<std::uint64_t>(y) * texture.width +
                              static_cast<std::uint64_t>(x);
  const std::uint32_t texel = scene.texels[index];
  const std::uint32_t r = texel & 0xffu, g = (texel >> 8) & 0xffu, b = (texel >> 16) & 0xffu;
  const float alpha = static_cast<float>(texel >> 24) / 255.0f;
  if (texture.srgb != 0) {
    const float* table = scene.srgb_to_linear;
    return {table[r], table[g], table[b], alpha};
  }
  return {static_cast<float>(r) / 255.0f, static_cast<float>(g) / 255.0f,
          static_cast<float>(b) / 255.0f, alpha};
}

// (u, v) as glTF has it: (0, 0) is the image's top left corner.
OCTRACE_HD inline Vec4 sample_texture(const SceneView& scene, std::uint32_t index, Vec2 uv) {
  const Texture& texture = scene.textures[index];
  const auto width = static_cast<std::int32_t>(texture.width);
  const auto height = static_cast<std::int32_t>(texture.height);
  const float x = wrap_coordinate(uv.x, texture.wrap_s) * static_cast<float>(width);
  const float y = wrap_coordinate(uv.y, texture.wrap_t) * static_cast<float>(height);
  if (texture.filter == Filter::nearest) {
    const auto column = static_cast<std::int32_t>(x);
    const auto row = static_cast<std::int32_t>(y);
    return fetch_texel(scene, texture, column < width ? column : width - 1,
                       row < height ? row : height - 1);
  }
  const float left = std::floor(x - 0.5f), top = std::floor(y - 0.5f);
  const float fx = (x - 0.5f) - left, fy = (y - 0.5f) - top;
  const auto column = static_cast<std::int32_t>(left);
  const auto row = static_cast<std::int32_t>(top);
  const std::int32_t x0 = wrap_texel(column, width, texture.wrap_s);
  const std::int32_t x1 = wrap_texel(column + 1, width, texture.wrap_s);
  const std::int32_t y0 = wrap_texel(row, height, texture.wrap_t);
  const std::int32_t y1 = wrap_texel(row + 1, height, texture.wrap_t);
  const Vec4 a = fetch_texel(scene, texture, x0, y0), b = fetch_texel(scene, texture, x1, y0);
  const Vec4 c = fetch_texel(scene, texture, x0, y1), d = fetch_texel(scene, texture, x1, y1);
  const Vec4 upper = a + fx * (b - a), lower = c + fx * (d - c);
  return upper + fy * (lower - upper);
}

// KHR_texture_transform.
OCTRACE_HD inline Vec2 transform_uv(const TextureRef& ref, Vec2 uv) {
  const Vec3 p{uv.x, uv.y, 1.0f};
  return {dot(ref.transform_u, p), dot(ref.transform_v, p)};
}

}  // namespace octrace::kernels
