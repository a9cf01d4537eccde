// Traces views on an NVIDIA GPU, band by band, so that an image of any size fits.
#pragma once

#include <array>

#include "backend/render/device_scene.h"
#include "backend/render/renderer.h"

namespace octrace::render {

class CudaRenderer final : public Renderer {
 public:
  // Errors: exit 6 where the device's memory is too small (bytes wanted and free in the message),
  // exit 7 for any other failure of CUDA.
  static util::Result<std::unique_ptr<CudaRenderer>> create(const scene::Scene& scene,
                                                            const octree::Octree& octree,
                                                            int device);

  util::Result<TraceStats> render(const kernels::RayCamera& camera, const Settings& settings,
                                  Framebuffer& framebuffer) override;
  util::Result<void> refresh(const scene::SceneChanges& changes) override;

 private:
  // Two bands are in flight: one is traced while the other is copied back.
  struct Band {
    DeviceStream stream;
    DeviceMemory planes, report;
    PinnedMemory host_planes, host_report;
    DeviceEvent begun, traced, copied;
    std::uint32_t first_row = 0, rows = 0;  // rows 0: idle
  };

  CudaRenderer(const scene::Scene& scene, const octree::Octree& octree)
      : source_(scene), octree_(octree) {}
  kernels::cuda::Status prepare(std::uint64_t bytes_a_row, std::uint32_t rows);
  util::Result<std::uint32_t> choose_rows(const Framebuffer& framebuffer);
  util::Result<kernels::MotionView> upload_motion(const kernels::RayCamera& camera,
                                                  const NextFrame& next);
  kernels::cuda::Status start(Band& band, const kernels::cuda::InstancedView& view,
                              Framebuffer& framebuffer, bool pinned);
  util::Result<void> finish(Band& band, Framebuffer& framebuffer, bool pinned, TraceStats& stats);

  const scene::Scene& source_;
  const octree::Octree& octree_;
  int device_ = 0;
  std::string device_name_;
  DeviceScene scene_;
  DeviceMemory next_positions_, next_instances_;  // of the motion plane's next frame
  std::array<Band, 2> bands_;
};

}  // namespace octrace::render
