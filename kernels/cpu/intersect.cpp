#include "kernels/cpu/intersect.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/intersect.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#undef OCTRACE_WIDE
#if HWY_MAX_BYTES >= 32 && HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128
#define OCTRACE_WIDE 1
#include "kernels/cpu/group-inl.h"
#include "kernels/cpu/packet-inl.h"
#include "kernels/cpu/stream-inl.h"
#else
#define OCTRACE_WIDE 0
#endif

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

#if OCTRACE_WIDE
// One ray at a time, where the next one depends on it.
template <class Query>
HWY_ATTR HWY_INLINE void trace_one(const WideView& tree, const SceneView& scene,
                                   const RenderParams& params, const Ray& from, WideRay& ray) {
  begin(tree, from, 0, ray);
  while (ray.ref != kDoneRef) {
    if ((ray.ref & kLeafRef) == 0) {
      visit_node<!Query::kAnyHit>(tree, ray);
      continue;
    }
    const Candidates found = candidates<Query>(tree, params, ray);
    if (found.certain != 0) {
      ray.opacity = kOpacityBlocked;
      return;
    }
    if (found.likely != 0 && test<Query>(tree, scene, params, ray, found.likely)) return;
    ray.pop();
  }
}
#endif

HWY_ATTR TraceStatus closest(const WideView& tree, const SceneView& scene,
                             const RenderParams& params, const Ray& ray, Hit* hit) {
#if OCTRACE_WIDE
  if (!tree.empty()) {
    WideRay walk;
    trace_one<ClosestQuery>(tree, scene, params, ray, walk);
    *hit = walk.hit;
    return TraceStatus::ok;
  }
#else
  (void)tree;
#endif
  return closest_hit(scene, params, ray, SimdChildTest{}, hit);
}

HWY_ATTR TraceStatus transmittance(const WideView& tree, const SceneView& scene,
                                   const RenderParams& params, const Ray& ray,
                                   float* transmittance) {
#if OCTRACE_WIDE
  if (!tree.empty()) {
    WideRay walk;
    trace_one<TransmittanceQuery>(tree, scene, params, ray, walk);
    *transmittance = transmittance_of(walk.opacity);
    return TraceStatus::ok;
  }
#else
  (void)tree;
#endif
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

#if OCTRACE_WIDE
// How many rays to trace on their own, where tracing them in groups has failed, before it is tried
// again.
inline constexpr std::uint32_t kStreamed = 4096;

// Calls store(index, ray) for each of rays[0, count).
template <class Query, class Store>
HWY_ATTR HWY_INLINE void trace_many(const WideView& tree, const SceneView& scene,
                                    const RenderParams& params, const Ray* rays,
                                    std::uint32_t count, const Store& store) {
  RayGroup groups[kGroups];
  for (std::uint32_t first = 0; first < count;) {
    GivenUp apart;
    const std::uint32_t grouped = trace_groups<Query>(
        tree, scene, params, rays + first, count - first, groups, apart,
        [&](std::uint32_t i, const RayState& ray) HWY_ATTR { store(first + i, ray); });
    for (std::uint32_t k = 0; k < apart.groups; ++k) apart.first[k] += first;
    first += grouped;
    const std::uint32_t streamed = count - first < kStreamed ? count - first : kStreamed;
    for (std::uint32_t k = 0; k <= apart.groups; ++k) {
      const std::uint32_t begin = k < apart.groups ? apart.first[k] : first;
      trace_stream<Query>(
          tree, scene, params, rays + begin, k < apart.groups ? apart.count[k] : streamed,
          [&](std::uint32_t i, const RayState& ray) HWY_ATTR { store(begin + i, ray); });
    }
    first += streamed;
  }
}
#endif

HWY_ATTR TraceStatus closest_stream(const WideView& tree, const SceneView& scene,
                                    const RenderParams& params, const Ray* rays,
                                    std::uint32_t count, Hit* hits) {
#if OCTRACE_WIDE
  if (!tree.empty()) {
    trace_many<ClosestQuery>(tree, scene, params, rays, count,
                             [&](std::uint32_t i, const RayState& state)
                                 HWY_ATTR { hits[i] = state.hit; });
    return TraceStatus::ok;
  }
#endif
  for (std::uint32_t i = 0; i < count; ++i) {
    const TraceStatus status = closest(tree, scene, params, rays[i], &hits[i]);
    if (status != TraceStatus::ok) return status;
  }
  return TraceStatus::ok;
}

inline constexpr std::uint32_t kMostStreamed = 1024;

HWY_ATTR TraceStatus closest_packets(const WideView& tree, const SceneView& scene,
                                     const RenderParams& params, const Ray* rays,
                                     std::uint32_t count, Hit* hits) {
#if OCTRACE_WIDE
  if (!tree.empty()) {
    Packet packet;
    // Where packets fail, more and more rays go into groups before the next one is tried.
    std::uint32_t streamed = kPacketRays;
    for (std::uint32_t first = 0, size; first < count; first += size) {
      size = count - first < kPacketRays ? count - first : kPacketRays;
      if (trace_packet(tree, scene, params, rays + first, size, packet, hits + first)) {
        streamed = kPacketRays;
        continue;
      }
      streamed = streamed < kMostStreamed ? 4 * streamed : streamed;
      size = count - first < streamed ? count - first : streamed;
      closest_stream(tree, scene, params, rays + first, size, hits + first);
    }
    return TraceStatus::ok;
  }
#endif
  return closest_stream(tree, scene, params, rays, count, hits);
}

HWY_ATTR TraceStatus transmittance_stream(const WideView& tree, const SceneView& scene,
                                          const RenderParams& params, const Ray* rays,
                                          std::uint32_t count, float* transmittances) {
#if OCTRACE_WIDE
  if (!tree.empty()) {
    trace_many<TransmittanceQuery>(tree, scene, params, rays, count,
                                   [&](std::uint32_t i, const RayState& state) HWY_ATTR {
                                     transmittances[i] = transmittance_of(state.opacity);
                                   });
    return TraceStatus::ok;
  }
#endif
  for (std::uint32_t i = 0; i < count; ++i) {
    const TraceStatus status = transmittance(tree, scene, params, rays[i], &transmittances[i]);
    if (status != TraceStatus::ok) return status;
  }
  return TraceStatus::ok;
}

HWY_ATTR bool uses_wide() { return OCTRACE_WIDE; }

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
HWY_EXPORT(closest_stream);
HWY_EXPORT(closest_packets);
HWY_EXPORT(transmittance_stream);
HWY_EXPORT(uses_wide);
HWY_EXPORT(instruction_set);

namespace {

std::size_t target_index() {
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return hwy::GetChosenTarget().GetIndex();
}

}  // namespace

CpuTracer::CpuTracer(const WideView& wide) : wide_(wide) {
  const std::size_t index = target_index();
  closest_ = HWY_DISPATCH_TABLE(closest)[index];
  transmittance_ = HWY_DISPATCH_TABLE(transmittance)[index];
  instanced_closest_ = HWY_DISPATCH_TABLE(instanced_closest)[index];
  instanced_transmittance_ = HWY_DISPATCH_TABLE(instanced_transmittance)[index];
  closest_packets_ = HWY_DISPATCH_TABLE(closest_packets)[index];
  closest_stream_ = HWY_DISPATCH_TABLE(closest_stream)[index];
  transmittance_stream_ = HWY_DISPATCH_TABLE(transmittance_stream)[index];
  instruction_set_ = HWY_DISPATCH_TABLE(instruction_set)[index]();
}

bool CpuTracer::uses_wide() { return HWY_DISPATCH_TABLE(uses_wide)[target_index()](); }

}  // namespace octrace::kernels
#endif
