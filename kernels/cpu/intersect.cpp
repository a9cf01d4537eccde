#include "kernels/cpu/intersect.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/intersect.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace octrace::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// kOrder[octant][mask]: bit s of mask moved to bit s ^ octant ^ 7.
struct VisitOrder {
  std::uint8_t order[8][256] = {};
  constexpr VisitOrder() {
    for (unsigned octant = 0; octant < 8; ++octant) {
      for (unsigned mask = 0; mask < 256; ++mask) {
        for (unsigned slot = 0; slot < 8; ++slot) {
          if ((mask >> slot) & 1) {
            order[octant][mask] |= static_cast<std::uint8_t>(1u << (slot ^ octant ^ 7u));
          }
        }
      }
    }
  }
};
inline constexpr VisitOrder kVisitOrder;

// The same computation as node_frame() and ScalarChildTest, over axes first and then over children.
struct SimdChildTest {
  // Not forced inline: the compiler refuses to force it into the portable traverse(), but inlines
  // it once traverse() itself has been inlined into a function of this target.
  HWY_ATTR inline NodeVisit operator()(const Node& node, const SlabRay& ray, float tmin,
                                       float tmax) const {
    const hn::CappedTag<float, kChildren> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    alignas(16) float step[4], near[4], far[4];
    frame(node, ray, step, near, far);
    std::uint32_t mask = 0;
    for (std::size_t first = 0; first < kChildren; first += hn::Lanes(d)) {
      auto entry = hn::Set(d, tmin);
      auto exit = hn::Set(d, tmax);
      for (int axis = 0; axis < 3; ++axis) {
        // lower and upper are neighbours, so that the sign of the direction is an offset.
        const std::size_t flip = ((ray.octant >> axis) & 1) * sizeof(node.lower);
        const std::uint8_t* lower = node.lower[axis] + first;
        const auto q_entry = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, lower + flip)));
        const auto q_exit =
            hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, lower + sizeof(node.lower) - flip)));
        entry = hn::Max(entry, hn::MulAdd(q_entry, hn::Set(d, step[axis]), hn::Set(d, near[axis])));
        exit = hn::Min(exit, hn::MulAdd(q_exit, hn::Set(d, step[axis]), hn::Set(d, far[axis])));
      }
      std::uint8_t bits[8];
      hn::StoreMaskBits(d, hn::Le(entry, exit), bits);
      mask |= static_cast<std::uint32_t>(bits[0]) << first;
    }
    const std::uint32_t inner = kVisitOrder.order[ray.octant][mask & node.inner_mask];
    ChildHits hits = inner << 24;
    for (std::uint32_t leaves = mask & ~node.inner_mask; leaves != 0; leaves &= leaves - 1) {
      const std::uint32_t meta = node.meta[lowest_bit(leaves)];
      hits |= (meta >> 5) << (meta & 31u);
    }
    return {hits, node.inner_mask, node.first_child, node.first_triangle};
  }

 private:
#if HWY_TARGET == HWY_SCALAR
  static HWY_ATTR inline void frame(const Node& node, const SlabRay& ray, float* step, float* near,
                                    float* far) {
    const NodeFrame f = node_frame(node, ray);
    for (int axis = 0; axis < 3; ++axis) {
      step[axis] = f.step[axis];
      near[axis] = f.near[axis];
      far[axis] = f.far[axis];
    }
  }
#else
  // The fourth lane holds the exponents' bytes read as a float, and is ignored.
  static HWY_ATTR inline void frame(const Node& node, const SlabRay& ray, float* step, float* near,
                                    float* far) {
    const hn::FixedTag<float, 4> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::int8_t, decltype(d)> d8;
    const auto biased = hn::Add(hn::PromoteTo(di, hn::LoadU(d8, node.exponent)), hn::Set(di, 127));
    const auto scale = hn::BitCast(d, hn::ShiftLeft<23>(biased));
    const auto inverse = hn::LoadU(d, &ray.inverse.x);
    const auto l = hn::Sub(hn::Load(d, node.origin), hn::LoadU(d, &ray.origin.x));
    const auto u = hn::Add(l, hn::Mul(hn::Set(d, 255.0f), scale));
    const auto m = hn::Max(hn::Abs(l), hn::Abs(u));
    const auto m_xy = hn::Max(m, hn::Reverse2(d, m));
    const float largest = greater(hn::GetLane(m_xy), hn::ExtractLane(m, 2));
    const auto padding = hn::Mul(hn::Set(d, largest * kChildPadding), hn::Abs(inverse));
    const auto base = hn::Mul(l, inverse);
    hn::Store(hn::Mul(scale, inverse), d, step);
    hn::Store(hn::Sub(base, padding), d, near);
    hn::Store(hn::Add(base, padding), d, far);
  }
#endif
};

HWY_ATTR TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray& ray,
                             Hit* hit) {
  return closest_hit(scene, params, ray, SimdChildTest{}, hit);
}

HWY_ATTR TraceStatus transmittance(const SceneView& scene, const RenderParams& params,
                                   const Ray& ray, float* transmittance) {
  return shadow_transmittance(scene, params, ray, SimdChildTest{}, transmittance);
}

HWY_ATTR TraceStatus instanced_closest(const InstancedSceneView& scene, const RenderParams& params,
                                       const Ray& ray, InstancedHit* hit) {
  return closest_hit(scene, params, ray, SimdChildTest{}, hit);
}

HWY_ATTR TraceStatus instanced_transmittance(const InstancedSceneView& scene,
                                             const RenderParams& params, const Ray& ray,
                                             float* transmittance) {
  return shadow_transmittance(scene, params, ray, SimdChildTest{}, transmittance);
}

// Highway counts AVX-512 as the third AVX.
HWY_ATTR const char* instruction_set() {
  return HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL ? "AVX-512"
                                                             : hwy::TargetName(HWY_TARGET);
}

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::kernels {

HWY_EXPORT(closest);
HWY_EXPORT(transmittance);
HWY_EXPORT(instanced_closest);
HWY_EXPORT(instanced_transmittance);
HWY_EXPORT(instruction_set);

CpuTracer::CpuTracer() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  closest_ = HWY_DISPATCH_TABLE(closest)[index];
  transmittance_ = HWY_DISPATCH_TABLE(transmittance)[index];
  instanced_closest_ = HWY_DISPATCH_TABLE(instanced_closest)[index];
  instanced_transmittance_ = HWY_DISPATCH_TABLE(instanced_transmittance)[index];
  instruction_set_ = HWY_DISPATCH_TABLE(instruction_set)[index]();
}

}  // namespace octrace::kernels
#endif
