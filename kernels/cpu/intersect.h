// Ray queries on the CPU, compiled for several instruction sets; the best one that the machine has
// is chosen at run time. All of them return the same bits.
#pragma once

#include "kernels/cpu/wide_node.h"
#include "kernels/instance_intersect.h"
#include "kernels/intersect.h"

namespace octrace::kernels {

class CpuTracer {
 public:
  // With wide nodes made from the octree of every scene that it is asked about, or without. It
  // keeps to the octree's own nodes where the machine's instruction set has no vectors of eight
  // floats.
  explicit CpuTracer(const WideView& wide = {});
  static bool uses_wide();

  TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray& ray,
                      Hit* hit) const {
    return closest_(wide_, scene, params, ray, hit);
  }
  TraceStatus transmittance(const SceneView& scene, const RenderParams& params, const Ray& ray,
                            float* transmittance) const {
    return transmittance_(wide_, scene, params, ray, transmittance);
  }
  // The same for many rays: faster than one by one, most of all where those near each other in the
  // array start close together, whatever their directions.
  TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray* rays,
                      std::uint32_t count, Hit* hits) const {
    return closest_stream_(wide_, scene, params, rays, count, hits);
  }
  TraceStatus transmittance(const SceneView& scene, const RenderParams& params, const Ray* rays,
                            std::uint32_t count, float* transmittances) const {
    return transmittance_stream_(wide_, scene, params, rays, count, transmittances);
  }
  // The same for rays of which every 32 in a row lie close together, as a camera's do.
  TraceStatus closest_coherent(const SceneView& scene, const RenderParams& params, const Ray* rays,
                               std::uint32_t count, Hit* hits) const {
    return closest_packets_(wide_, scene, params, rays, count, hits);
  }
  TraceStatus closest(const InstancedSceneView& scene, const RenderParams& params, const Ray& ray,
                      InstancedHit* hit) const {
    return instanced_closest_(scene, params, ray, hit);
  }
  TraceStatus transmittance(const InstancedSceneView& scene, const RenderParams& params,
                            const Ray& ray, float* transmittance) const {
    return instanced_transmittance_(scene, params, ray, transmittance);
  }
  const char* instruction_set() const { return instruction_set_; }  // "AVX2"

 private:
  template <class Result>
  using One = TraceStatus (*)(const WideView&, const SceneView&, const RenderParams&, const Ray&,
                              Result*);
  template <class Result>
  using Many = TraceStatus (*)(const WideView&, const SceneView&, const RenderParams&, const Ray*,
                               std::uint32_t, Result*);
  WideView wide_;
  One<Hit> closest_;
  One<float> transmittance_;
  Many<Hit> closest_stream_, closest_packets_;
  Many<float> transmittance_stream_;
  TraceStatus (*instanced_closest_)(const InstancedSceneView&, const RenderParams&, const Ray&,
                                    InstancedHit*);
  TraceStatus (*instanced_transmittance_)(const InstancedSceneView&, const RenderParams&,
                                          const Ray&, float*);
  const char* instruction_set_;
};

}  // namespace octrace::kernels
