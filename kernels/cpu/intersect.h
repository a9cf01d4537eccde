// Ray queries on the CPU, compiled for several instruction sets; the best one that the machine has
// is chosen at run time. All of them return the same bits.
#pragma once

#include "kernels/instance_intersect.h"
#include "kernels/intersect.h"

namespace octrace::kernels {

class CpuTracer {
 public:
  CpuTracer();
  TraceStatus closest(const SceneView& scene, const RenderParams& params, const Ray& ray,
                      Hit* hit) const {
    return closest_(scene, params, ray, hit);
  }
  TraceStatus transmittance(const SceneView& scene, const RenderParams& params, const Ray& ray,
                            float* transmittance) const {
    return transmittance_(scene, params, ray, transmittance);
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
  TraceStatus (*closest_)(const SceneView&, const RenderParams&, const Ray&, Hit*);
  TraceStatus (*transmittance_)(const SceneView&, const RenderParams&, const Ray&, float*);
  TraceStatus (*instanced_closest_)(const InstancedSceneView&, const RenderParams&, const Ray&,
                                    InstancedHit*);
  TraceStatus (*instanced_transmittance_)(const InstancedSceneView&, const RenderParams&,
                                          const Ray&, float*);
  const char* instruction_set_;
};

}  // namespace octrace::kernels
