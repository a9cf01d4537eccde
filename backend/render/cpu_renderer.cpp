#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <fstream>
#include <limits>
#include <mutex>
#include <vector>

#include "backend/octree/wide.h"
#include "backend/render/outline.h"
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
  const Outline& outline;
  bool geometry, beauty;
  const kernels::MotionView* motion;  // null: no motion plane
};

struct TileCounts {
  std::uint64_t camera = 0;
  kernels::RayCounts beauty;
};

template <class Scene, class Tracer>
TraceStatus geometry_pixel(const View& view, const Scene& scene, const Tracer& tracer,
                           std::uint32_t x, std::uint32_t y) {
  return view.motion == nullptr
             ? trace_geometry(scene, view.camera, view.params, view.target, x, y, tracer)
             : trace_geometry(scene, view.camera, view.params, view.target, x, y, tracer,
                              kernels::MotionPlane{*view.motion});
}

// Calls visit(x, y) for the pixels of the tile, in blocks of 4x4, until it fails.
template <class Visit>
TileFailure visit_pixels(const Tile& tile, const Visit& visit) {
  constexpr std::uint32_t kBlock = 4;
  for (std::uint32_t y0 = tile.y0; y0 < tile.y1; y0 += kBlock) {
    for (std::uint32_t x0 = tile.x0; x0 < tile.x1; x0 += kBlock) {
      for (std::uint32_t y = y0; y < std::min(y0 + kBlock, tile.y1); ++y) {
        for (std::uint32_t x = x0; x < std::min(x0 + kBlock, tile.x1); ++x) {
          const TraceStatus status = visit(x, y);
          if (status != TraceStatus::ok) return {status, x, y};
        }
      }
    }
  }
  return {};
}

// Calls visit(x, y) for the pixels of the blocks, in order, until it fails.
template <class Visit>
TileFailure visit_pixels(const std::vector<Tile>& blocks, const Visit& visit) {
  for (const Tile& block : blocks) {
    const TileFailure failure = visit_pixels(block, visit);
    if (failure.status != TraceStatus::ok) return failure;
  }
  return {};
}

// What store_background() writes, for all pixels of the block.
void fill_background(const View& view, const Tile& block) {
  constexpr auto kFar = std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity());
  for (const AovInfo& info : aov_table()) {
    auto* const plane = static_cast<std::uint32_t*>(view.target.planes[static_cast<int>(info.aov)]);
    if (plane == nullptr || info.aov == Aov::beauty) continue;
    const bool far = info.aov == Aov::depth || info.aov == Aov::distance;
    const auto channels = static_cast<std::uint64_t>(info.channel_count);
    for (std::uint32_t y = block.y0; y < block.y1; ++y) {
      std::fill_n(plane + view.target.pixel(block.x0, y) * channels,
                  (block.x1 - block.x0) * channels, far ? kFar : 0u);
    }
  }
}

// The blocks of the tile that may see something; the others become background.
std::vector<Tile> fill_what_sees_nothing(const View& view, const Tile& tile) {
  constexpr std::uint32_t kBlock = 16;
  std::vector<Tile> left;
  for (std::uint32_t y = tile.y0; y < tile.y1; y += kBlock) {
    for (std::uint32_t x = tile.x0; x < tile.x1; x += kBlock) {
      const Tile block{x, y, std::min(x + kBlock, tile.x1), std::min(y + kBlock, tile.y1)};
      if (view.outline.may_see(block)) {
        left.push_back(block);
      } else {
        fill_background(view, block);
      }
    }
  }
  return left;
}

// The planes of `kKept` for the pixels of some blocks, from their rays and hits in the order of
// visit_pixels().
template <Aov... kKept, class Motion = kernels::NoMotion>
void store_planes(const View& view, const kernels::SceneView& scene,
                  const std::vector<kernels::Ray>& rays, const std::vector<kernels::Hit>& hits,
                  const std::vector<Tile>& blocks, const Motion& motion = {}) {
  const kernels::PlanesOf<kKept...> planes{view.target};
  if (!planes.any()) return;
  std::size_t next = 0;
  visit_pixels(blocks, [&](std::uint32_t x, std::uint32_t y) {
    store_geometry(scene, rays[next], hits[next], planes, x, y, motion);
    ++next;
    return TraceStatus::ok;
  });
}

std::vector<kernels::Ray> camera_rays(const kernels::RayCamera& camera, const Tile& tile,
                                      const std::vector<Tile>& blocks) {
  std::vector<kernels::CameraRayPart> columns, rows;
  for (std::uint32_t x = tile.x0; x < tile.x1; ++x) {
    columns.push_back(camera_column(camera, static_cast<float>(x) + 0.5f));
  }
  for (std::uint32_t y = tile.y0; y < tile.y1; ++y) {
    rows.push_back(camera_row(camera, static_cast<float>(y) + 0.5f));
  }
  std::size_t count = 0;
  for (const Tile& block : blocks) {
    count += std::size_t{block.x1 - block.x0} * (block.y1 - block.y0);
  }
  std::vector<kernels::Ray> rays(count);
  std::size_t next = 0;
  visit_pixels(blocks, [&](std::uint32_t x, std::uint32_t y) {
    rays[next++] = camera_ray(camera, columns[x - tile.x0], rows[y - tile.y0]);
    return TraceStatus::ok;
  });
  return rays;
}

// The rays of a tile are traced together, because neighbours meet the same nodes.
TileFailure trace_geometry_tile(const View& view, const kernels::SceneView& scene,
                                const kernels::CpuTracer& tracer, const Tile& tile) {
  const std::vector<Tile> blocks = fill_what_sees_nothing(view, tile);
  if (blocks.empty()) return {};
  const std::vector<kernels::Ray> rays = camera_rays(view.camera, tile, blocks);
  std::vector<kernels::Hit> hits(rays.size());
  const TraceStatus status = tracer.closest_coherent(
      scene, view.params, rays.data(), static_cast<std::uint32_t>(rays.size()), hits.data());
  if (status != TraceStatus::ok) {  // one by one, to say which pixel it is
    return visit_pixels(blocks, [&](std::uint32_t x, std::uint32_t y) {
      return geometry_pixel(view, scene, tracer, x, y);
    });
  }
  store_planes<Aov::depth>(view, scene, rays, hits, blocks);
  store_planes<Aov::distance>(view, scene, rays, hits, blocks);
  store_planes<Aov::mask>(view, scene, rays, hits, blocks);
  store_planes<Aov::barycentric>(view, scene, rays, hits, blocks);
  store_planes<Aov::object_id>(view, scene, rays, hits, blocks);
  store_planes<Aov::material_id>(view, scene, rays, hits, blocks);
  store_planes<Aov::primitive_id>(view, scene, rays, hits, blocks);
  // These share the surface that they are taken from.
  store_planes<Aov::normal, Aov::geometric_normal, Aov::position, Aov::albedo, Aov::uv>(
      view, scene, rays, hits, blocks);
  if (view.motion != nullptr) {
    store_planes<Aov::motion>(view, scene, rays, hits, blocks, kernels::MotionPlane{*view.motion});
  }
  return {};
}

TileFailure trace_tile(const View& view, const kernels::SceneView& scene,
                       const kernels::CpuTracer& tracer, const Tile& tile, TileCounts* counts) {
  if (view.geometry) {
    const TileFailure failure = trace_geometry_tile(view, scene, tracer, tile);
    if (failure.status != TraceStatus::ok) return failure;
    counts->camera += std::uint64_t{tile.x1 - tile.x0} * (tile.y1 - tile.y0);
  }
  if (!view.beauty) return {};
  return visit_pixels(tile, [&](std::uint32_t x, std::uint32_t y) {
    return trace_beauty(scene, view.camera, view.params, view.target, x, y, tracer,
                        &counts->beauty);
  });
}

// A scene with instances: each ray for itself.
TileFailure trace_tile(const View& view, const kernels::InstancedSceneView& scene,
                       const kernels::CpuTracer& tracer, const Tile& tile, TileCounts* counts) {
  return visit_pixels(tile, [&](std::uint32_t x, std::uint32_t y) {
    if (view.geometry) {
      ++counts->camera;
      const TraceStatus status = geometry_pixel(view, scene, tracer, x, y);
      if (status != TraceStatus::ok) return status;
    }
    if (!view.beauty) return TraceStatus::ok;
    return trace_beauty(scene, view.camera, view.params, view.target, x, y, tracer,
                        &counts->beauty);
  });
}

// The geometry's rays of a tile are traced together: more of them share more work, as long as there
// are several tiles a thread. Beauty's go one by one, and their cost varies more.
std::uint32_t tile_side(const Framebuffer& image, bool beauty, unsigned threads) {
  constexpr std::uint32_t kLeast = 16, kMost = 64;
  constexpr std::uint64_t kTilesPerThread = 8;
  if (beauty) return kLeast;
  const std::uint64_t pixels = std::uint64_t{image.width()} * image.height();
  std::uint32_t side = kMost;
  while (side > kLeast &&
         pixels < std::uint64_t{side} * side * kTilesPerThread * effective_threads(threads)) {
    side /= 2;
  }
  return side;
}

class CpuRenderer final : public Renderer {
 public:
  CpuRenderer(const scene::Scene& scene, const octree::Octree& octree)
      : source_(scene), octree_(octree) {
    look(true);
  }

  util::Result<TraceStats> render(const kernels::RayCamera& camera, const Settings& settings,
                                  Framebuffer& framebuffer) override;
  util::Result<void> refresh(const scene::SceneChanges& changes) override {
    look(changes.geometry());
    return {};
  }

 private:
  void look(bool moved) {
    scene_ = octree::instanced_view(source_, octree_);
    if (!moved) return;
    wide_ = {};  // before the new ones are made
    // Only scenes without instances are walked by their wide nodes.
    wide_ = kernels::CpuTracer::uses_wide() && scene_.top.nodes.empty()
                ? octree::make_wide(scene_.octree)
                : octree::WideOctree{};
    tracer_ = kernels::CpuTracer(wide_.view());
  }

  const scene::Scene& source_;
  const octree::Octree& octree_;
  kernels::InstancedSceneView scene_;
  octree::WideOctree wide_;
  kernels::CpuTracer tracer_;
  TileRunner tiles_;
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
  const Outline outline(scene_.octree, camera);
  const View view{scene_,  camera,         settings.params, framebuffer.view(),
                  outline, geometry.any(), beauty,          wants_motion ? &motion : nullptr};

  TraceStats stats;
  TileFailure failure;
  std::mutex mutex;
  TileJob job;
  job.width = framebuffer.width();
  job.height = framebuffer.height();
  job.tile = settings.tile != 0 ? settings.tile : tile_side(framebuffer, beauty, settings.threads);
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
  switch (tiles_.run(job)) {
    case TileOutcome::failed:
      return trace_error(failure);
    case TileOutcome::cancelled:
      return util::Error{util::Exit::internal, "CANCELLED", "the render was cancelled", "", ""};
    case TileOutcome::done:
      break;
  }
  stats.walk_bytes = wide_.bytes();
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
