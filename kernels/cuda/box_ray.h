// The 8-child box test for one thread, counted in instructions of the integer and comparison unit,
// which has half the rate of the multiply-add unit and is what a walk is bound by (Ylitie, Karras
// and Laine 2017 describe the node; the ways to save below are of this file).
//
// - A byte q becomes the float 2^15 + q by one byte permute; the 2^15 is taken off with the plane's
//   constant. That rounds by 2^-9 of a step at most, for which kBiasError leaves 2^-8.
// - Distances are compared as integers, three at a time (Hopper's VIMNMX3). Floats order like
//   integers unless both are negative; entries count from 0 on, as tmin does, and an exit that is
//   negative at all is below that.
// - A child is missed where exit - entry has its sign bit set; the bits are shifted together.
// - The padding of kernels/box.h is taken once a ray, from the root's box, in place of once a node.
//   It can only be wider, so the test stays conservative.
#pragma once

#include "kernels/traverse.h"

namespace octrace::kernels::cuda {

inline constexpr float kByteBias = 32768.0f;
inline constexpr std::uint32_t kByteBiasBits = 0x47000000u;
inline constexpr float kBiasError = 1.0f / 256;  // their sum is a float

struct BoxRay {
  Vec3 origin;
  Vec3 inverse;
  Vec3 widen;            // the padding in units of t
  Vec3 bias;             // -2^15, and 2^-8 towards the ray's origin
  std::uint32_t octant;  // bit a: direction is negative along axis a
};

struct ChildMask {
  std::uint32_t hit;  // bit s: the ray meets the box in slot s
  std::uint32_t inner_mask, first_child, first_triangle;
  std::uint32_t meta[2];
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
  const float padding = largest * kChildPadding;
  return {ray.origin, ray.inverse,
          Vec3(padding * fabsf(ray.inverse.x), padding * fabsf(ray.inverse.y),
               padding * fabsf(ray.inverse.z)),
          Vec3(-kByteBias - copysignf(kBiasError, ray.inverse.x),
               -kByteBias - copysignf(kBiasError, ray.inverse.y),
               -kByteBias - copysignf(kBiasError, ray.inverse.z)),
          ray.octant};
}

class ChildTest {
 public:
  // The node's children that the ray may meet between 0 and tmax.
  // byte_bias: kByteBiasBits. Were its value known, the compiler would put it into the permutes and
  // move their selectors into registers, 40 instructions more.
  __device__ OCTRACE_FORCE_INLINE static ChildMask test(const Node& node, const BoxRay& ray,
                                                        float tmax, std::uint32_t byte_bias) {
    const uint4* p = reinterpret_cast<const uint4*>(&node);
    const uint4 n0 = __ldg(p), n1 = __ldg(p + 1), n2 = __ldg(p + 2), n3 = __ldg(p + 3),
                n4 = __ldg(p + 4);
    const Axis x = axis(__uint_as_float(n0.x), scale_of(n0.w, 0), ray.origin.x, ray.inverse.x,
                        ray.widen.x, ray.bias.x);
    const Axis y = axis(__uint_as_float(n0.y), scale_of(n0.w, 1), ray.origin.y, ray.inverse.y,
                        ray.widen.y, ray.bias.y);
    const Axis z = axis(__uint_as_float(n0.z), scale_of(n0.w, 2), ray.origin.z, ray.inverse.z,
                        ray.widen.z, ray.bias.z);
    const bool nx = ray.octant & 1, ny = ray.octant & 2, nz = ray.octant & 4;
    std::uint32_t missed = 0;
    half(x, y, z, nx ? n3.w : n2.y, ny ? n4.y : n2.w, nz ? n4.w : n3.y, nx ? n2.y : n3.w,
         ny ? n2.w : n4.y, nz ? n3.y : n4.w, tmax, byte_bias, &missed);
    half(x, y, z, nx ? n3.z : n2.x, ny ? n4.x : n2.z, nz ? n4.z : n3.x, nx ? n2.x : n3.z,
         ny ? n2.z : n4.x, nz ? n3.x : n4.z, tmax, byte_bias, &missed);
    return {~missed & 0xffu, n0.w >> 24, n1.x, n1.y, {n1.z, n1.w}};
  }

 private:
  struct Axis {
    float step, near, far;
  };

  __device__ OCTRACE_FORCE_INLINE static Axis axis(float origin, float scale, float ray_origin,
                                                   float inverse, float widen, float bias) {
    const float l = origin - ray_origin;
    const float step = scale * inverse;
    return {step, fma_rn(step, bias, fma_rn(l, inverse, -widen)),
            fma_rn(step, -2.0f * kByteBias - bias, fma_rn(l, inverse, widen))};
  }

  template <int kByte>
  __device__ OCTRACE_FORCE_INLINE static float biased(std::uint32_t bytes,
                                                      std::uint32_t byte_bias) {
    return __uint_as_float(__byte_perm(bytes, byte_bias, 0x7404 | kByte << 4));
  }

  template <int kByte>
  __device__ OCTRACE_FORCE_INLINE static void child(const Axis& x, const Axis& y, const Axis& z,
                                                    std::uint32_t near_x, std::uint32_t near_y,
                                                    std::uint32_t near_z, std::uint32_t far_x,
                                                    std::uint32_t far_y, std::uint32_t far_z,
                                                    float tmax, std::uint32_t byte_bias,
                                                    std::uint32_t* missed) {
    const int entry =
        __vimax3_s32_relu(__float_as_int(fma_rn(biased<kByte>(near_x, byte_bias), x.step, x.near)),
                          __float_as_int(fma_rn(biased<kByte>(near_y, byte_bias), y.step, y.near)),
                          __float_as_int(fma_rn(biased<kByte>(near_z, byte_bias), z.step, z.near)));
    const int exit =
        min(__vimin3_s32(__float_as_int(fma_rn(biased<kByte>(far_x, byte_bias), x.step, x.far)),
                         __float_as_int(fma_rn(biased<kByte>(far_y, byte_bias), y.step, y.far)),
                         __float_as_int(fma_rn(biased<kByte>(far_z, byte_bias), z.step, z.far))),
            __float_as_int(tmax));
    *missed =
        __funnelshift_l(__float_as_uint(__int_as_float(exit) - __int_as_float(entry)), *missed, 1);
  }

  // Four children, from the highest slot down.
  __device__ OCTRACE_FORCE_INLINE static void half(const Axis& x, const Axis& y, const Axis& z,
                                                   std::uint32_t near_x, std::uint32_t near_y,
                                                   std::uint32_t near_z, std::uint32_t far_x,
                                                   std::uint32_t far_y, std::uint32_t far_z,
                                                   float tmax, std::uint32_t byte_bias,
                                                   std::uint32_t* missed) {
    child<3>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax, byte_bias, missed);
    child<2>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax, byte_bias, missed);
    child<1>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax, byte_bias, missed);
    child<0>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax, byte_bias, missed);
  }
};

}  // namespace octrace::kernels::cuda
