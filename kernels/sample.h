// Random numbers without state: a hash of (pixel, sample, dimension, seed), so that every device,
// thread and tile draws the same ones. A pixel's samples are stratified in each pair of dimensions:
// correlated multi-jittered sampling, Kensler 2013, Pixar technical memo 13-01.
#pragma once

#include "kernels/config.h"
#include "kernels/vector_math.h"

namespace octrace::kernels {

// Wellons' "lowbias32".
OCTRACE_HD inline std::uint32_t hash(std::uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

OCTRACE_HD inline std::uint32_t hash(std::uint32_t a, std::uint32_t b) {
  return hash(a ^ (hash(b) + 0x9e3779b9u + (a << 6) + (a >> 2)));
}

// [0, 1): 24 bits, so that the largest value does not round to 1.
OCTRACE_HD inline float to_unit(std::uint32_t bits) {
  return static_cast<float>(bits >> 8) * (1.0f / 16777216.0f);
}

// The i-th element of a permutation of [0, length) chosen by `pattern` (Kensler 2013, listing 5).
OCTRACE_HD inline std::uint32_t permute(std::uint32_t i, std::uint32_t length,
                                        std::uint32_t pattern) {
  std::uint32_t w = length - 1;
  w |= w >> 1;
  w |= w >> 2;
  w |= w >> 4;
  w |= w >> 8;
  w |= w >> 16;
  do {
    i ^= pattern;
    i *= 0xe170893du;
    i ^= pattern >> 16;
    i ^= (i & w) >> 4;
    i ^= pattern >> 8;
    i *= 0x0929eb3fu;
    i ^= pattern >> 23;
    i ^= (i & w) >> 1;
    i *= 1 | pattern >> 27;
    i *= 0x6935fa69u;
    i ^= (i & w) >> 11;
    i *= 0x74dcb303u;
    i ^= (i & w) >> 2;
    i *= 0x9e501cc3u;
    i ^= (i & w) >> 2;
    i *= 0xc860a3dfu;
    i &= w;
    i ^= i >> 5;
  } while (i >= length);
  return (i + pattern) % length;
}

// One of a pixel's samples.
struct Sampler {
  std::uint32_t pixel;   // hash of the pixel and the seed
  std::uint32_t sample;  // 0 .. count - 1
  std::uint32_t count;

  OCTRACE_HD float get1(std::uint32_t dimension) const {
    const std::uint32_t pattern = hash(pixel, dimension);
    const auto stratum = static_cast<float>(permute(sample, count, pattern));
    const float jitter = to_unit(hash(pattern, sample));
    return lesser((stratum + jitter) / static_cast<float>(count), 0x1.fffffep-1f);
  }

  OCTRACE_HD Vec2 get2(std::uint32_t dimension) const {
    const std::uint32_t pattern = hash(pixel, dimension);
    const auto columns = columns_of_strata();
    const std::uint32_t rows = (count + columns - 1) / columns;
    const std::uint32_t s = permute(sample, count, pattern * 0x51633e2du);
    const std::uint32_t sx = permute(s % columns, columns, pattern * 0x68bc21ebu);
    const std::uint32_t sy = permute(s / columns, rows, pattern * 0x02e5be93u);
    const float jx = to_unit(hash(pattern ^ 0x967a889bu, s));
    const float jy = to_unit(hash(pattern ^ 0x368cc8b7u, s));
    const float x =
        (static_cast<float>(sx) + (static_cast<float>(sy) + jx) / static_cast<float>(rows)) /
        static_cast<float>(columns);
    const float y = (static_cast<float>(s) + jy) / static_cast<float>(count);
    return {lesser(x, 0x1.fffffep-1f), lesser(y, 0x1.fffffep-1f)};
  }

 private:
  OCTRACE_HD std::uint32_t columns_of_strata() const {
    const auto root = static_cast<std::uint32_t>(square_root(static_cast<float>(count)));
    return root > 0 ? root : 1;
  }
};

OCTRACE_HD inline Sampler make_sampler(std::uint32_t x, std::uint32_t y, std::uint32_t seed,
                                       std::uint32_t sample, std::uint32_t count) {
  return {hash(hash(x, y), seed), sample, count};
}

// Uniform on the unit disk, without folding strata (Shirley and Chiu 1997). Sine and cosine are
// Taylor polynomials on [-pi/4, pi/4], within 3e-8, because libm's differ from device to device.
OCTRACE_HD inline Vec2 sample_disk(Vec2 uniform) {
  const float a = 2.0f * uniform.x - 1.0f, b = 2.0f * uniform.y - 1.0f;
  const bool wide = abs_of(a) > abs_of(b);
  const float radius = wide ? a : b;
  if (radius == 0.0f) return Vec2(0.0f);
  const float phi = (kPi * 0.25f) * (wide ? b / a : a / b);
  const float q = phi * phi;
  const float sine =
      phi * (1.0f + q * (-1.0f / 6 + q * (1.0f / 120 + q * (-1.0f / 5040 + q * (1.0f / 362880)))));
  const float cosine =
      1.0f + q * (-1.0f / 2 + q * (1.0f / 24 + q * (-1.0f / 720 + q * (1.0f / 40320))));
  return wide ? Vec2(radius * cosine, radius * sine) : Vec2(radius * sine, radius * cosine);
}

// About +z, density cos(theta) / pi.
OCTRACE_HD inline Vec3 sample_cosine(Vec2 uniform) {
  const Vec2 p = sample_disk(uniform);
  return {p.x, p.y, square_root(greater(1.0f - dot(p, p), 0.0f))};
}

// Two unit vectors that complete `z` to a right-handed basis (Duff et al. 2017, JCGT 6(1)).
struct Basis {
  Vec3 x, y, z;
  OCTRACE_HD Vec3 to_world(Vec3 v) const { return v.x * x + v.y * y + v.z * z; }
  OCTRACE_HD Vec3 to_local(Vec3 v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
};

OCTRACE_HD inline Basis make_basis(Vec3 z) {
  const float sign = z.z < 0.0f ? -1.0f : 1.0f;
  const float a = -1.0f / (sign + z.z);
  const float b = z.x * z.y * a;
  return {{1.0f + sign * z.x * z.x * a, sign * b, -sign * z.x}, {b, sign + z.y * z.y * a, -z.y}, z};
}

}  // namespace octrace::kernels
