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

struct SimdChildTest {
  // Not forced inline: the compiler refuses to force it into the portable traverse(), but inlines
  // it once traverse() itself has been inlined into a function of this target.
  HWY_ATTR inline ChildHits operator()(const Node& node, const SlabRay& ray, float tmin,
                                       float tmax) const {
    const hn::CappedTag<float, kChildren> d;
    const hn::RebindToSigned<decltype(d)> di;
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const NodeFrame frame = node_frame(node, ray);
    std::uint32_t mask = 0;
    for (std::size_t first = 0; first < kChildren; first += hn::Lanes(d)) {
      auto near = hn::Set(d, tmin);
      auto far = hn::Set(d, tmax);
      for (int axis = 0; axis < 3; ++axis) {
        const bool negative = (ray.octant >> axis) & 1;
        const std::uint8_t* entry = (negative ? node.upper : node.lower)[axis] + first;
        const std::uint8_t* exit = (negative ? node.lower : node.upper)[axis] + first;
        const auto step = hn::Set(d, frame.step[axis]);
        const auto q_entry = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, entry)));
        const auto q_exit = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, exit)));
        near = hn::Max(near, hn::MulAdd(q_entry, step, hn::Set(d, frame.near[axis])));
        far = hn::Min(far, hn::MulAdd(q_exit, step, hn::Set(d, frame.far[axis])));
      }
      std::uint8_t bits[8] = {};
      hn::StoreMaskBits(d, hn::Le(near, far), bits);
      mask |= static_cast<std::uint32_t>(bits[0]) << first;
    }
    ChildHits hits = static_cast<ChildHits>(kVisitOrder.order[ray.octant][mask & node.inner_mask])
                     << 24;
    for (std::uint32_t leaves = mask & ~node.inner_mask; leaves != 0; leaves &= leaves - 1) {
      const std::uint32_t meta = node.meta[lowest_bit(leaves)];
      hits |= (meta >> 5) << (meta & 31u);
    }
    return hits;
  }
};

HWY_ATTR TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray& ray,
                             Hit* hit) {
  return closest_hit(scene, params, ray, SimdChildTest{}, hit);
}

HWY_ATTR TraceStatus transmittance(const SceneView& scene, const RenderParams& params,
                                   const Ray& ray, float* transmittance) {
  return shadow_transmittance(scene, params, ray, SimdChildTest{}, transmittance);
}

HWY_ATTR const char* instruction_set() { return hwy::TargetName(HWY_TARGET); }

}  // namespace octrace::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace octrace::kernels {

HWY_EXPORT(closest);
HWY_EXPORT(transmittance);
HWY_EXPORT(instruction_set);

CpuTracer::CpuTracer() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto index = hwy::GetChosenTarget().GetIndex();
  closest_ = HWY_DISPATCH_TABLE(closest)[index];
  transmittance_ = HWY_DISPATCH_TABLE(transmittance)[index];
  instruction_set_ = HWY_DISPATCH_TABLE(instruction_set)[index]();
}

}  // namespace octrace::kernels
#endif
