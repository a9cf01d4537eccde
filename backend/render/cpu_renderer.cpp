#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <mutex>

#include "backend/render/renderer.h"
#include "backend/render/tiles.h"
#include "kernels/cpu/intersect.h"
#include "kernels/instance_motion.h"
#include "kernels/pixel.h"

namespace octrace::render {

namespace {

using kernels::TraceStatus;

std::string cpu_model() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown CPU";
}

util::Error trace_error(const TileFailure& failure) {
  const char* what = failure.status == TraceStatus::stack_overflow
                         ? "the traversal's stack overflowed"
                         : "the traversal visited more nodes than there are";
  return {util::Exit::internal, "",
          fmt::format("pixel ({}, {}): {}: the octree is broken (--verify says where)", failure.x,
                      failure.y, what),
          "", ""};
}

struct View {
  const kernels::InstancedSceneView& scene;
  const kernels::RayCamera& camera;
  const kernels::RenderParams& params;
  kernels::FramebufferView target;
  bool geometry, beauty;
  const kernels::MotionView* motion;  // null: no motion plane
};

struct TileCounts {
  std::uint64_t camera = 0;
  kernels::RayCounts beauty;
};

template <class Scene>
TraceStatus trace_pixel(const View& view, const Scene& scene, const kernels::CpuTracer& tracer,
                        std::uint32_t x, std::uint32_t y, TileCounts* counts) {
  if (view.geometry) {
    ++counts->camera;
    const TraceStatus status =
        view.motion == nullptr
            ? trace_geometry(scene, view.camera, view.params, view.target, x, y, tracer)
            : trace_geometry(scene, view.camera, view.params, view.target, x, y, tracer,
                             kernels::MotionPlane{*view.motion});
    if (status != TraceStatus::ok) return status;
  }
  if (!view.beauty) return TraceStatus::ok;
  return trace_beauty(scene, view.camera, view.params, view.target, x, y, tracer, &counts->beauty);
}

template <class Scene>
TileFailure trace_tile(const View& view, const Scene& scene, const kernels::CpuTracer& tracer,
                       const Tile& tile, TileCounts* counts) {
  for (std::uint32_t y = tile.y0; y < tile.y1; ++y) {
    for (std::uint32_t x = tile.x0; x < tile.x1; ++x) {
      const TraceStatus status = trace_pixel(view, scene, tracer, x, y, counts);
      if (status != TraceStatus::ok) return {status, x, y};
    }
  }
  return {};
}

class CpuRenderer final : public Renderer {
 public:
  CpuRenderer(const scene::Scene& scene, const octree::Octree& octree)
      : source_(scene), octree_(octree) {
    look();
  }

  util::Result<TraceStats> render(const kernels::RayCamera& camera, const Settings& settings,
                                  Framebuffer& framebuffer) override;
  util::Result<void> refresh(const scene::SceneChanges&) override {
    look();
    return {};
  }

 private:
  void look() { scene_ = octree::instanced_view(source_, octree_); }

  const scene::Scene& source_;
  const octree::Octree& octree_;
  kernels::InstancedSceneView scene_;
  kernels::CpuTracer tracer_;
};

util::Result<TraceStats> CpuRenderer::render(const kernels::RayCamera& camera,
                                             const Settings& settings, Framebuffer& framebuffer) {
  const auto start = std::chrono::steady_clock::now();
  AovSet geometry = framebuffer.aovs();
  geometry.reset(static_cast<std::size_t>(Aov::beauty));
  const bool beauty = framebuffer.aovs().test(static_cast<std::size_t>(Aov::beauty));
  if (beauty && settings.params.spp == 0) {
    return util::Error{util::Exit::usage, "", "beauty needs at least one sample a pixel (--spp)",
                       "", ""};
  }
  const bool wants_motion = geometry.test(static_cast<std::size_t>(Aov::motion));
  const kernels::MotionView motion =
      settings.next ? make_motion_view(camera, *settings.next) : kernels::MotionView{};
  const View view{scene_,
                  camera,
                  settings.params,
                  framebuffer.view(),
                  geometry.any(),
                  beauty,
                  wants_motion ? &motion : nullptr};

  TraceStats stats;
  TileFailure failure;
  std::mutex mutex;
  TileJob job;
  job.width = framebuffer.width();
  job.height = framebuffer.height();
  job.tile = settings.tile;
  job.threads = settings.threads;
  job.progress = settings.progress;
  job.cancel = settings.cancel;
  job.work = [&](const Tile& tile) {
    TileCounts counts;
    // Scenes without instances are traced by code that knows none.
    const kernels::SceneView& world = scene_;
    const TileFailure result = scene_.top.nodes.empty()
                                   ? trace_tile(view, world, tracer_, tile, &counts)
                                   : trace_tile(view, scene_, tracer_, tile, &counts);
    const std::lock_guard lock(mutex);
    stats.camera_rays += counts.camera;
    stats.beauty_rays += counts.beauty.beauty;
    stats.shadow_rays += counts.beauty.shadow;
    if (result.status != TraceStatus::ok) failure = result;
    return result.status == TraceStatus::ok;
  };
  switch (run_tiles(job)) {
    case TileOutcome::failed:
      return trace_error(failure);
    case TileOutcome::cancelled:
      return util::Error{util::Exit::internal, "CANCELLED", "the render was cancelled", "", ""};
    case TileOutcome::done:
      break;
  }
  const unsigned threads = effective_threads(settings.threads);
  stats.device = fmt::format("cpu: {}, {} {}, {}", cpu_model(), threads,
                             threads == 1 ? "thread" : "threads", tracer_.instruction_set());
  stats.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return stats;
}

}  // namespace

std::unique_ptr<Renderer> make_cpu_renderer(const scene::Scene& scene,
                                            const octree::Octree& octree) {
  return std::make_unique<CpuRenderer>(scene, octree);
}

}  // namespace octrace::render
