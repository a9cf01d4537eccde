// Traces one view of a scene into a framebuffer, on some device.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "backend/octree/octree.h"
#include "backend/render/framebuffer.h"
#include "backend/render/motion.h"
#include "backend/scene/scene.h"
#include "backend/scene/scene_changes.h"
#include "kernels/camera.h"
#include "kernels/render_params.h"

namespace octrace::render {

struct Settings {
  kernels::RenderParams params;
  unsigned threads = 0;    // 0: all
  std::uint32_t tile = 0;  // pixels a side, 0: by the image; never changes the image
  // Called now and then from one thread at a time with the share of pixels done, 0 to 1.
  std::function<void(double)> progress;
  const std::atomic<bool>* cancel = nullptr;
  std::optional<NextFrame> next;  // for the motion plane, which is 0 without it
};

struct TraceStats {
  std::uint64_t camera_rays = 0;  // geometry AOVs: their pixels, of filled background as well
  std::uint64_t beauty_rays = 0;  // camera, transparency and sky rays of beauty
  std::uint64_t shadow_rays = 0;
  double seconds = 0.0;
  // On a GPU, by its own clock; copies overlap kernels, so the two may add up to more than seconds.
  double kernel_seconds = 0.0, download_seconds = 0.0;
  double upload_seconds = 0.0;   // of the scene to the device, once a scene; 0 on the CPU
  std::uint64_t walk_bytes = 0;  // of nodes made from the octree for the CPU; 0 on a GPU
  std::string device;            // "cpu: AMD EPYC 9654, 2 threads, AVX2"
};

class Renderer {
 public:
  virtual ~Renderer() = default;
  virtual util::Result<TraceStats> render(const kernels::RayCamera& camera,
                                          const Settings& settings, Framebuffer& framebuffer) = 0;

  // To be called between renders where the scene or the octree that the renderer was made for has
  // changed (scene::Animator, octree::update()). Errors as when a renderer is made.
  virtual util::Result<void> refresh(const scene::SceneChanges& changes) = 0;
};

// The scene and the octree must outlive the renderer.
std::unique_ptr<Renderer> make_cpu_renderer(const scene::Scene& scene,
                                            const octree::Octree& octree);

}  // namespace octrace::render
