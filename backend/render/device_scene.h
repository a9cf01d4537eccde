// A scene and its octree in device memory, uploaded once for as many views as wanted.
#pragma once

#include <vector>

#include "backend/octree/octree.h"
#include "backend/render/device_memory.h"
#include "backend/scene/scene.h"
#include "backend/scene/scene_changes.h"

namespace octrace::render {

class DeviceScene {
 public:
  // Out of memory is reported as such (Status::out_of_memory); nothing is left allocated then.
  kernels::cuda::Status upload(const scene::Scene& scene, const octree::Octree& octree);

  // Copies what changed to where it lies, or everything where arrays have other sizes (a rebuilt
  // octree). No render of the scene may be under way.
  kernels::cuda::Status update(const scene::Scene& scene, const octree::Octree& octree,
                               const scene::SceneChanges& changes);

  // Pointers into device memory.
  const kernels::InstancedSceneView& view() const { return view_; }
  std::uint64_t bytes() const { return bytes_; }
  double upload_seconds() const { return seconds_; }

  static std::uint64_t bytes_needed(const scene::Scene& scene, const octree::Octree& octree);

 private:
  kernels::InstancedSceneView view_;
  DeviceMemory memory_;
  std::uint64_t bytes_ = 0;
  double seconds_ = 0.0;
};

}  // namespace octrace::render
