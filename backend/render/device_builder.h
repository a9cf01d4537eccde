// Builds the octree on an NVIDIA GPU, for scenes whose building takes longer than their tracing.
#pragma once

#include "backend/octree/octree.h"
#include "backend/render/device_memory.h"

namespace octrace::render {

// The input's arrays in device memory and room for the octree and all that building it needs.
class DeviceBuilder {
 public:
  // Errors: exit 6 where the device's memory is too small, exit 7 for any other failure of CUDA.
  util::Result<void> load(const octree::BuildInput& input, int device);

  // Builds what load() brought. Seconds are the device's own, from the scene's arrays to the
  // finished octree, both in device memory. Errors: exit 6 where the octree would be deeper than a
  // walk's stack.
  util::Result<double> build();

  // What the last build() made.
  util::Result<octree::Octree> download() const;

 private:
  DeviceMemory positions_, triangles_, triangle_geometry_, flags_;
  DeviceMemory scratch_, nodes_, leaf_triangles_, report_;
  DeviceEvent begun_, done_;
  kernels::cuda::BuildScene scene_{};
  kernels::cuda::BuildReport made_{};
};

// load(), build() and download() in one; an empty octree of no triangles.
util::Result<octree::Octree> build_on_device(const octree::BuildInput& input, int device);

}  // namespace octrace::render
