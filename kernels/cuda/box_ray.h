// The 8-child box test for one thread, two children an instruction in half precision, counted in
// instructions of the integer and comparison unit, which has half the rate of the multiply-add unit
// (Ylitie, Karras and Laine 2017 describe the node; the ways to save below are of this file).
//
// - A byte q between zero bytes is the half q * 2^-24, a denormal, exact and full speed. So a
// plane's
//   distance is one fused multiply-add of two children's bytes.
// - Distances are counted from where the ray enters the node, t0, in units that make the steepest
//   axis' step kSteepest: t' = (t - t0) * unit. Halves have 11 bits, and a node has 8.
// - Distances are compared as integers, three at a time (Hopper's VIMNMX3). Halves order like
//   integers unless both are negative; entries count from t0 on, and an exit that is negative at
//   all is below that.
// - The padding of kernels/box.h is taken once a ray, from the root's box, in place of once a node.
//   It can only be wider, so the test stays conservative.
//
// Why it is conservative. Let h = t' of a point of the ray inside a child's padded box, with
// t0 <= t <= tmax. Rounding is monotone: where the exact fused sum of a near plane is at most h and
// that of a far plane at least h, their halves are on either side of h's half, and so is tmax's.
// What is left is the rounding of step and offset to halves. The step is off by 2^-11 of itself,
// which makes at most 255 * 2^-11 steps of a plane. The offset b, the distance of plane 0, is off
// by 2^-11 of |b|, and |b| is at most 255 steps and twice the margin, for the ray is between the
// node's planes at h. Together below 1/4 of a step: kMargin leaves 5/16. Offsets that are denormal
// are off by 2^-25, for which kHalfError leaves 2^-24. Singles are off by at most 2^-21 of the
// distance that the padding is 2^-19 of, of which the triangles' own boxes take 2^-20.
#pragma once

#include <cuda_fp16.h>

#include "kernels/traverse.h"

namespace octrace::kernels::cuda {

inline constexpr float kSteepest = 60000.0f;             // of at most 65504, a half's largest
inline constexpr float kByteUnit = 1.0f / (1 << 24);     // what a byte of 1 is as a half
inline constexpr float kHalfError = 1.0f / (1 << 24);    // of t'
inline constexpr float kMargin = 5.0f / 16 * kByteUnit;  // in bytes

// How much steeper one axis may be than another. Beyond it, half precision would not tell apart
// distances along the other: an axis that is nearly perpendicular to the ray counts as this steep,
// and boxes are padded by what that moves the ray in the scene's box.
inline constexpr float kSteeper = 32768.0f;

struct BoxRay {
  Vec3 origin;
  Vec3 inverse;
  Vec3 entered;   // the byte of the plane where the ray enters a node's frame: 0, or 255 as a half
  float padding;  // of boxes, as a distance
};

struct ChildMask {
  std::uint32_t hit;  // bit s: the ray meets the box in slot s
  std::uint32_t inner_mask, first_child, first_triangle;
  std::uint32_t meta[2];
  // Of the inner children met, if the test was asked to order them: the slot of the one entered
  // first, and a distance before any other is entered.
  std::uint32_t nearest;
  float others;
};

// What Node::exponent stands for, from its byte in the high bits of a word.
__device__ OCTRACE_FORCE_INLINE float scale_of(std::uint32_t word, int axis) {
  const int exponent = static_cast<std::int8_t>(word >> (8 * axis));
  return __int_as_float((exponent + 127) << 23);
}

__device__ OCTRACE_FORCE_INLINE BoxRay make_box_ray(const SlabRay& ray, const Node* root) {
  const uint4 head = __ldg(reinterpret_cast<const uint4*>(root));
  const float lower[3] = {__uint_as_float(head.x), __uint_as_float(head.y),
                          __uint_as_float(head.z)};
  float largest = 0.0f;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const float l = lower[axis] - ray.origin[axis];
    const float u = fma_rn(255.0f, scale_of(head.w, axis), l);
    largest = fmaxf(largest, fmaxf(fabsf(l), fabsf(u)));
  }
  const float limit =
      kSteeper * fminf(fminf(fabsf(ray.inverse.x), fabsf(ray.inverse.y)), fabsf(ray.inverse.z));
  BoxRay box_ray;
  box_ray.origin = ray.origin;
  bool steep = false;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.inverse[axis];
    steep |= fabsf(inverse) > limit;
    box_ray.inverse[axis] = copysignf(fminf(fabsf(inverse), limit), inverse);
    box_ray.entered[axis] = inverse < 0.0f ? 255.0f * kByteUnit : 0.0f;
  }
  // While the ray is in the scene's box, it goes at most `largest` along its main axis, so at most
  // that over kSteeper along one that counts as steep.
  box_ray.padding = largest * (steep ? kChildPadding + 1.0f / kSteeper : kChildPadding);
  return box_ray;
}

class ChildTest {
 public:
  // The node's children that the ray may meet between 0 and tmax.
  template <bool kOrder>
  __device__ OCTRACE_FORCE_INLINE static ChildMask test(const Node& node, const BoxRay& ray,
                                                        float tmax) {
    const uint4* p = reinterpret_cast<const uint4*>(&node);
    const uint4 n0 = __ldg(p), n1 = __ldg(p + 1), n2 = __ldg(p + 2), n3 = __ldg(p + 3),
                n4 = __ldg(p + 4);
    // Exponents are -60 or more and below 100, so no byte carries into the next: they become those
    // of floats 2^24 times as large.
    const std::uint32_t exponents = (n0.w ^ 0x808080u) + 0x171717u;
    const Plane x = plane(__uint_as_float(n0.x), exponents << 23, ray.origin.x, ray.inverse.x,
                          ray.entered.x, ray.padding);
    const Plane y = plane(__uint_as_float(n0.y), exponents << 15, ray.origin.y, ray.inverse.y,
                          ray.entered.y, ray.padding);
    const Plane z = plane(__uint_as_float(n0.z), exponents << 7, ray.origin.z, ray.inverse.z,
                          ray.entered.z, ray.padding);
    const float t0 = __int_as_float(__vimax3_s32_relu(
        __float_as_int(x.entry), __float_as_int(y.entry), __float_as_int(z.entry)));
    // The summand keeps it finite where a node is a point.
    const float tick =
        fma_rn(fmaxf(fmaxf(fabsf(x.step), fabsf(y.step)), fabsf(z.step)), 1.0f / kSteepest, 1e-35f);
    const float unit = reciprocal(tick);
    const float near0 = fma_rn(-t0, unit, -kHalfError), far0 = fma_rn(-t0, unit, kHalfError);
    const __half2 near_x = halves(x.step * unit, fma_rn(x.near, unit, near0));
    const __half2 near_y = halves(y.step * unit, fma_rn(y.near, unit, near0));
    const __half2 near_z = halves(z.step * unit, fma_rn(z.near, unit, near0));
    const __half2 far_xy = halves(fma_rn(x.far, unit, far0), fma_rn(y.far, unit, far0));
    const __half2 far_z_end = halves(fma_rn(z.far, unit, far0), fma_rn(tmax, unit, far0));
    const Frame frame = {{__low2half2(near_x), __low2half2(near_y), __low2half2(near_z)},
                         {__high2half2(near_x), __high2half2(near_y), __high2half2(near_z)},
                         {__low2half2(far_xy), __high2half2(far_xy), __low2half2(far_z_end)},
                         bits_of(__high2half2(far_z_end))};
    const bool nx = ray.inverse.x < 0.0f, ny = ray.inverse.y < 0.0f, nz = ray.inverse.z < 0.0f;
    const Planes low = {nx ? n3.z : n2.x, ny ? n4.x : n2.z, nz ? n4.z : n3.x,
                        nx ? n2.x : n3.z, ny ? n2.z : n4.x, nz ? n3.x : n4.z};
    const Planes high = {nx ? n3.w : n2.y, ny ? n4.y : n2.w, nz ? n4.w : n3.y,
                         nx ? n2.y : n3.w, ny ? n2.w : n4.y, nz ? n3.y : n4.w};
    const Met a = meets(frame, even(low)), b = meets(frame, odd(low)), c = meets(frame, even(high)),
              d = meets(frame, odd(high));
    // Slots 0 and 4 are at bits 0 and 4 of the lower halves, 2 and 6 at theirs of the upper ones.
    const std::uint32_t hit = (a.mask & 0x00040001u) | (b.mask & 0x00080002u) |
                              (c.mask & 0x00400010u) | (d.mask & 0x00800020u);
    ChildMask children = {(hit | hit >> 16) & 0xffu, n0.w >> 24, n1.x, n1.y, {n1.z, n1.w}, 0, 0.0f};
    if constexpr (kOrder) {
      const std::uint32_t inner = children.inner_mask;
      const std::uint32_t inner_low = sign_bits(inner & 15u), inner_high = sign_bits(inner >> 4);
      const Least least = least_two(key(a, spread_signs<0xaa88>(inner_low), 0x00020000u),
                                    key(b, spread_signs<0xbb99>(inner_low), 0x00030001u),
                                    key(c, spread_signs<0xaa88>(inner_high), 0x00060004u),
                                    key(d, spread_signs<0xbb99>(inner_high), 0x00070005u));
      children.nearest = least.first & 7u;
      // Taking 8 off a key leaves a half below the entry distance's own, and so below the exact
      // distance that was rounded to it. In the ray's t that is t0 and so many ticks: 2^-20 off the
      // tick covers the approximate reciprocal's last place and the product's rounding, and the sum
      // is rounded down. Not a number, and so never behind a hit, where there is no second child or
      // it is entered at once.
      const float second =
          __half2float(__ushort_as_half(static_cast<unsigned short>(least.second - 8u)));
      children.others = __fmaf_rd(second, tick * (1.0f - 0x1p-20f), t0);
    }
    return children;
  }

 private:
  // One axis of a node: where the plane of byte 0 is met, early and late by padding and margin; the
  // step to byte 2^24; where the ray enters the frame.
  struct Plane {
    float step, near, far, entry;
  };
  // The same by axis, each as a pair of equal halves; tmax's bits.
  struct Frame {
    __half2 step[3], near[3], far[3];
    std::uint32_t end;
  };
  // Of two children: 0xffff in the half of each that the ray meets, and where it enters them.
  struct Met {
    std::uint32_t mask, entry;
  };
  // Bytes of the planes where boxes are entered and left.
  struct Planes {
    std::uint32_t near_x, near_y, near_z, far_x, far_y, far_z;
  };

  __device__ OCTRACE_FORCE_INLINE static Plane plane(float origin, std::uint32_t scale_bits,
                                                     float ray_origin, float inverse, float entered,
                                                     float padding) {
    const float scale = __uint_as_float(scale_bits & 0x7f800000u);
    const float l = origin - ray_origin;
    const float widen = fma_rn(scale, kMargin, padding) * fabsf(inverse);
    Plane plane;
    plane.step = scale * inverse;
    plane.near = fma_rn(l, inverse, -widen);
    plane.far = fma_rn(l, inverse, widen);
    plane.entry = fma_rn(plane.step, entered, plane.near);
    return plane;
  }

  __device__ OCTRACE_FORCE_INLINE static float reciprocal(float a) {
    float result;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(result) : "f"(a));
    return result;
  }

  __device__ OCTRACE_FORCE_INLINE static __half2 halves(float low, float high) {
    return __floats2half2_rn(low, high);
  }
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t bits_of(const __half2& pair) {
    return reinterpret_cast<const std::uint32_t&>(pair);
  }
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t distance(std::uint32_t bytes,
                                                                const __half2& step,
                                                                const __half2& base) {
    return bits_of(__hfma2(reinterpret_cast<const __half2&>(bytes), step, base));
  }

  __device__ OCTRACE_FORCE_INLINE static Met meets(const Frame& f, const Planes& p) {
    const std::uint32_t entry = __vimax3_s16x2_relu(distance(p.near_x, f.step[0], f.near[0]),
                                                    distance(p.near_y, f.step[1], f.near[1]),
                                                    distance(p.near_z, f.step[2], f.near[2]));
    const std::uint32_t exit = __vmins2(__vimin3_s16x2(distance(p.far_x, f.step[0], f.far[0]),
                                                       distance(p.far_y, f.step[1], f.far[1]),
                                                       distance(p.far_z, f.step[2], f.far[2])),
                                        f.end);
    return {__hle2_mask(reinterpret_cast<const __half2&>(entry),
                        reinterpret_cast<const __half2&>(exit)),
            entry};
  }

  // Bits 0 to 3 to the highest bits of four bytes; other bits of the result mean nothing.
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t sign_bits(std::uint32_t bits) {
    return bits * 0x10204080u;
  }
  // The highest bits of two bytes to two halves of 0 or 0xffff.
  template <unsigned kBytes>
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t spread_signs(std::uint32_t signs) {
    std::uint32_t result;
    asm("prmt.b32 %0, %1, 0, %2;" : "=r"(result) : "r"(signs), "n"(kBytes));
    return result;
  }

  // Two children's entry distances with their slots in the low bits; 0xffff if the child is a leaf
  // or not met. Distances that differ in those bits only go by slot.
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t key(const Met& met, std::uint32_t inner,
                                                           std::uint32_t slots) {
    return ((met.entry & 0xfff8fff8u) | slots) | ~(met.mask & inner);
  }

  struct Least {
    std::uint32_t first, second;  // in the lower halves
  };
  __device__ OCTRACE_FORCE_INLINE static Least least_two(std::uint32_t a, std::uint32_t b,
                                                         std::uint32_t c, std::uint32_t d) {
    const std::uint32_t ab = __vminu2(a, b), cd = __vminu2(c, d);
    const std::uint32_t first = __vminu2(ab, cd);
    const std::uint32_t second = __vimin3_u16x2(__vmaxu2(ab, cd), __vmaxu2(a, b), __vmaxu2(c, d));
    const std::uint32_t other = swap_halves(first);
    return {__vminu2(first, other),
            __vimin3_u16x2(__vmaxu2(first, other), second, swap_halves(second))};
  }
  __device__ OCTRACE_FORCE_INLINE static std::uint32_t swap_halves(std::uint32_t x) {
    return __byte_perm(x, 0, 0x1032u);
  }

  // Of four children's bytes, the first and the third, or the second and the fourth, as halves.
  __device__ OCTRACE_FORCE_INLINE static Planes even(const Planes& p) {
    constexpr std::uint32_t mask = 0x00ff00ffu;
    return {p.near_x & mask, p.near_y & mask, p.near_z & mask,
            p.far_x & mask,  p.far_y & mask,  p.far_z & mask};
  }
  __device__ OCTRACE_FORCE_INLINE static Planes odd(const Planes& p) {
    constexpr std::uint32_t bytes = 0x4341u;
    return {__byte_perm(p.near_x, 0, bytes), __byte_perm(p.near_y, 0, bytes),
            __byte_perm(p.near_z, 0, bytes), __byte_perm(p.far_x, 0, bytes),
            __byte_perm(p.far_y, 0, bytes),  __byte_perm(p.far_z, 0, bytes)};
  }
};

}  // namespace octrace::kernels::cuda
