// The 8-child box test for one thread: the node in five 16-byte loads, four children's meta bytes
// at a time (Ylitie, Karras and Laine 2017, listing 1). The arithmetic is ScalarChildTest's.
#pragma once

#include "kernels/traverse.h"

namespace octrace::kernels::cuda {

// 0xff in every byte whose highest bit is set.
__device__ OCTRACE_FORCE_INLINE std::uint32_t spread_sign_bits(std::uint32_t bytes) {
  std::uint32_t result;
  asm("prmt.b32 %0, %1, 0x0, 0x0000BA98;" : "=r"(result) : "r"(bytes));
  return result;
}

struct SimtChildTest {
  __device__ OCTRACE_FORCE_INLINE NodeVisit operator()(const Node& node, const SlabRay& ray,
                                                       float tmin, float tmax) const {
    const uint4* p = reinterpret_cast<const uint4*>(&node);
    const uint4 n0 = __ldg(p), n1 = __ldg(p + 1), n2 = __ldg(p + 2), n3 = __ldg(p + 3),
                n4 = __ldg(p + 4);
    const NodeFrame frame = this->frame(n0, ray);
    const std::uint32_t flips = (ray.octant ^ 7u) * 0x01010101u;
    ChildHits hits = half(n1.z, ray, frame, flips, n2.x, n2.z, n3.x, n3.z, n4.x, n4.z, tmin, tmax);
    hits |= half(n1.w, ray, frame, flips, n2.y, n2.w, n3.y, n3.w, n4.y, n4.w, tmin, tmax);
    return {hits, n0.w >> 24, n1.x, n1.y};
  }

 private:
  __device__ OCTRACE_FORCE_INLINE static NodeFrame frame(const uint4& n0, const SlabRay& ray) {
    Node head;
    head.origin[0] = __uint_as_float(n0.x);
    head.origin[1] = __uint_as_float(n0.y);
    head.origin[2] = __uint_as_float(n0.z);
    head.exponent[0] = static_cast<std::int8_t>(n0.w);
    head.exponent[1] = static_cast<std::int8_t>(n0.w >> 8);
    head.exponent[2] = static_cast<std::int8_t>(n0.w >> 16);
    return node_frame(head, ray);
  }

  __device__ OCTRACE_FORCE_INLINE static float byte(std::uint32_t bytes, int i) {
    return static_cast<float>((bytes >> (8 * i)) & 0xffu);
  }

  // Four children: their meta bytes and the bytes of their boxes.
  __device__ OCTRACE_FORCE_INLINE static ChildHits half(
      std::uint32_t meta, const SlabRay& ray, const NodeFrame& frame, std::uint32_t flips,
      std::uint32_t lower_x, std::uint32_t lower_y, std::uint32_t lower_z, std::uint32_t upper_x,
      std::uint32_t upper_y, std::uint32_t upper_z, float tmin, float tmax) {
    // Inner children are those with bits 3 and 4 set; only their index depends on the octant.
    const std::uint32_t inner = (meta & (meta << 1)) & 0x10101010u;
    const std::uint32_t index = (meta ^ (flips & spread_sign_bits(inner << 3))) & 0x1f1f1f1fu;
    const std::uint32_t bits = (meta >> 5) & 0x07070707u;
    const bool nx = ray.octant & 1, ny = ray.octant & 2, nz = ray.octant & 4;
    const std::uint32_t near_x = nx ? upper_x : lower_x, far_x = nx ? lower_x : upper_x;
    const std::uint32_t near_y = ny ? upper_y : lower_y, far_y = ny ? lower_y : upper_y;
    const std::uint32_t near_z = nz ? upper_z : lower_z, far_z = nz ? lower_z : upper_z;
    ChildHits hits = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const float entry = fmaxf(fmaxf(fma_rn(byte(near_x, i), frame.step.x, frame.near.x),
                                      fma_rn(byte(near_y, i), frame.step.y, frame.near.y)),
                                fmaxf(fma_rn(byte(near_z, i), frame.step.z, frame.near.z), tmin));
      const float exit = fminf(fminf(fma_rn(byte(far_x, i), frame.step.x, frame.far.x),
                                     fma_rn(byte(far_y, i), frame.step.y, frame.far.y)),
                               fminf(fma_rn(byte(far_z, i), frame.step.z, frame.far.z), tmax));
      if (entry <= exit) {
        hits |= ((bits >> (8 * i)) & 0xffu) << ((index >> (8 * i)) & 0xffu);
      }
    }
    return hits;
  }
};

}  // namespace octrace::kernels::cuda
