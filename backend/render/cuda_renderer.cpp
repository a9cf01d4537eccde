#include "backend/render/cuda_renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <span>
#include <utility>

#include "backend/util/log.h"

namespace octrace::render {

namespace {

using kernels::cuda::Report;
using kernels::cuda::Status;
using util::Error;
using util::Exit;

// Enough pixels to fill the largest GPU several times over, few enough that copying back one band
// overlaps tracing the next.
constexpr std::uint64_t kPixelsPerBand = 1u << 20;

std::uint64_t plane_bytes_a_row(const Framebuffer& framebuffer, const AovInfo& info) {
  return std::uint64_t{framebuffer.width()} * static_cast<std::uint64_t>(info.channel_count) * 4;
}

// Calls visit(info, offset of the plane in a band's memory, bytes a row) for every plane asked for.
template <class Visit>
void for_each_plane(const Framebuffer& framebuffer, std::uint32_t rows, Visit&& visit) {
  std::uint64_t offset = 0;
  for (const AovInfo& info : aov_table()) {
    if (!framebuffer.aovs().test(static_cast<std::size_t>(info.aov))) continue;
    const std::uint64_t bytes = plane_bytes_a_row(framebuffer, info);
    visit(info, offset, bytes);
    offset += bytes * rows;
  }
}

std::uint64_t bytes_a_row(const Framebuffer& framebuffer) {
  std::uint64_t bytes = 0;
  for_each_plane(framebuffer, 1,
                 [&](const AovInfo&, std::uint64_t, std::uint64_t row) { bytes += row; });
  return bytes;
}

// Planes that are filled again and again are locked in their place, and the device copies to them;
// of those that are filled but once a copy in memory takes less time than locking them.
class PinnedPlanes final : public PlaneHold {
 public:
  PinnedPlanes(int device, std::span<std::uint32_t> words) : device_(device), words_(words) {}
  ~PinnedPlanes() override {
    if (!pinned_) return;
    kernels::cuda::select_device(device_);  // another thread's would be the first GPU
    kernels::cuda::unpin(words_.data());
  }
  bool pin() {
    if (tried_) return pinned_;
    tried_ = true;  // what the system refuses once is not asked for again
    return pinned_ = kernels::cuda::pin(words_.data(), words_.size_bytes()).ok();
  }

 private:
  const int device_;
  std::span<std::uint32_t> words_;
  bool tried_ = false, pinned_ = false;
};

bool pin_when_reused(int device, Framebuffer& framebuffer) {
  if (auto* const planes = dynamic_cast<PinnedPlanes*>(framebuffer.hold().get())) {
    return planes->pin();
  }
  framebuffer.hold() = std::make_unique<PinnedPlanes>(device, framebuffer.words());
  return false;
}

Error trace_error(const Report& report) {
  return {Exit::internal, "",
          fmt::format("pixel ({}, {}): the traversal failed (status {}): the octree is broken "
                      "(--verify says where)",
                      report.x, report.y, report.status),
          "", ""};
}

Error memory_error(const char* what, std::uint64_t wanted, int device) {
  kernels::cuda::Device info{};
  kernels::cuda::query_device(device, &info);
  return {
      Exit::limit, "OUT_OF_DEVICE_MEMORY",
      fmt::format("{} needs {} bytes of device memory, {} are free", what, wanted, info.free_bytes),
      "", ""};
}

}  // namespace

util::Result<std::unique_ptr<CudaRenderer>> CudaRenderer::create(const scene::Scene& scene,
                                                                 const octree::Octree& octree,
                                                                 int device) {
  std::unique_ptr<CudaRenderer> renderer(new CudaRenderer(scene, octree));
  renderer->device_ = device;
  kernels::cuda::Device info{};
  Status status = kernels::cuda::select_device(device);
  if (status.ok()) status = kernels::cuda::query_device(device, &info);
  if (!status.ok()) return cuda_error(status);
  renderer->device_name_ = fmt::format("cuda:{}: {}", device, info.name);
  status = renderer->scene_.upload(scene, octree);
  if (status.out_of_memory()) {
    return memory_error("the scene", DeviceScene::bytes_needed(scene, octree), device);
  }
  for (Band& band : renderer->bands_) {
    if (status.ok()) status = band.stream.create();
    for (DeviceEvent* event : {&band.begun, &band.traced, &band.copied}) {
      if (status.ok()) status = event->create();
    }
    if (status.ok()) status = band.report.reserve(sizeof(Report));
    if (status.ok()) status = band.host_report.reserve(sizeof(Report));
  }
  if (!status.ok()) return cuda_error(status);
  return renderer;
}

util::Result<void> CudaRenderer::refresh(const scene::SceneChanges& changes) {
  Status status = kernels::cuda::select_device(device_);
  if (status.ok()) status = scene_.update(source_, octree_, changes);
  if (status.out_of_memory()) {
    return memory_error("the scene", DeviceScene::bytes_needed(source_, octree_), device_);
  }
  if (!status.ok()) return cuda_error(status);
  return {};
}

util::Result<kernels::MotionView> CudaRenderer::upload_motion(const kernels::RayCamera& camera,
                                                              const NextFrame& next) {
  kernels::MotionView motion = make_motion_view(camera, next);
  Status status;
  const auto upload = [&]<class T>(kernels::Span<T>& span, DeviceMemory& memory) {
    const std::uint64_t bytes = span.size * sizeof(T);
    if (bytes == 0 || !status.ok()) return;
    status = memory.reserve(bytes);
    if (status.ok()) {
      status = kernels::cuda::copy_to_device(memory.data(), span.data, bytes, nullptr);
    }
    span.data = static_cast<const T*>(memory.data());
  };
  upload(motion.next_positions, next_positions_);
  upload(motion.next_instances, next_instances_);
  if (status.out_of_memory()) {
    return memory_error("the next frame", next.positions.size_bytes() + next.instances.size_bytes(),
                        device_);
  }
  if (status.ok()) status = kernels::cuda::synchronize(nullptr);
  if (!status.ok()) return cuda_error(status);
  return motion;
}

Status CudaRenderer::prepare(std::uint64_t row_bytes, std::uint32_t rows) {
  for (Band& band : bands_) {
    if (Status s = band.planes.reserve(row_bytes * rows); !s.ok()) return s;
    if (Status s = band.host_planes.reserve(row_bytes * rows); !s.ok()) return s;
  }
  return {};
}

// Rows of a band: halved until the memory is there.
util::Result<std::uint32_t> CudaRenderer::choose_rows(const Framebuffer& framebuffer) {
  const std::uint64_t row_bytes = bytes_a_row(framebuffer);
  const std::uint64_t wanted = std::max<std::uint64_t>(1, kPixelsPerBand / framebuffer.width());
  auto rows = static_cast<std::uint32_t>(std::min<std::uint64_t>(wanted, framebuffer.height()));
  const std::uint32_t first_try = rows;
  for (;; rows /= 2) {
    if (rows == 0) return memory_error("one row of the image", 2 * row_bytes, device_);
    const Status status = prepare(row_bytes, rows);
    if (status.ok()) break;
    if (!status.out_of_memory()) return cuda_error(status);
  }
  if (rows != first_try) {
    util::log_warning(
        fmt::format("{}: {} bytes for {} rows a launch are not free; tracing {} rows a launch",
                    device_name_, 2 * row_bytes * first_try, first_try, rows));
  }
  return rows;
}

Status CudaRenderer::start(Band& band, const kernels::cuda::InstancedView& whole,
                           Framebuffer& framebuffer, bool pinned) {
  kernels::cuda::InstancedView view = whole;
  view.target = {};
  view.target.width = framebuffer.width();
  view.target.height = band.rows;
  view.target.first_row = band.first_row;
  auto* planes = static_cast<std::byte*>(band.planes.data());
  for_each_plane(framebuffer, band.rows,
                 [&](const AovInfo& info, std::uint64_t offset, std::uint64_t) {
                   view.target.planes[static_cast<int>(info.aov)] = planes + offset;
                 });
  auto* report = static_cast<Report*>(band.report.data());
  const kernels::cuda::Stream stream = band.stream.get();
  Status s = kernels::cuda::clear(report, sizeof(Report), stream);
  if (s.ok()) s = kernels::cuda::record_event(band.begun.get(), stream);
  if (s.ok()) {
    s = view.instanced.top.nodes.empty()
            ? kernels::cuda::launch_view(view, report, stream)
            : kernels::cuda::launch_instanced_view(view, report, stream);
  }
  if (s.ok()) s = kernels::cuda::record_event(band.traced.get(), stream);
  if (pinned) {
    const kernels::FramebufferView to = framebuffer.view();
    for_each_plane(framebuffer, band.rows,
                   [&](const AovInfo& info, std::uint64_t offset, std::uint64_t row) {
                     auto* plane = static_cast<std::byte*>(to.planes[static_cast<int>(info.aov)]);
                     if (!s.ok()) return;
                     s = kernels::cuda::copy_to_host(plane + row * band.first_row, planes + offset,
                                                     row * band.rows, stream);
                   });
  } else if (s.ok()) {
    s = kernels::cuda::copy_to_host(band.host_planes.data(), planes,
                                    bytes_a_row(framebuffer) * band.rows, stream);
  }
  if (s.ok()) {
    s = kernels::cuda::copy_to_host(band.host_report.data(), report, sizeof(Report), stream);
  }
  if (s.ok()) s = kernels::cuda::record_event(band.copied.get(), stream);
  return s;
}

util::Result<void> CudaRenderer::finish(Band& band, Framebuffer& framebuffer, bool pinned,
                                        TraceStats& stats) {
  const std::uint32_t rows = std::exchange(band.rows, 0);
  if (rows == 0) return {};
  if (Status s = kernels::cuda::synchronize(band.stream.get()); !s.ok()) return cuda_error(s);
  const Report& report = *static_cast<const Report*>(band.host_report.data());
  if (report.status != 0) return trace_error(report);
  float trace_ms = 0.0f, copy_ms = 0.0f;
  Status timed = kernels::cuda::elapsed(band.begun.get(), band.traced.get(), &trace_ms);
  if (timed.ok()) timed = kernels::cuda::elapsed(band.traced.get(), band.copied.get(), &copy_ms);
  if (!timed.ok()) return cuda_error(timed);
  stats.kernel_seconds += trace_ms * 1e-3;
  stats.download_seconds += copy_ms * 1e-3;
  stats.beauty_rays += report.beauty_rays;
  stats.shadow_rays += report.shadow_rays;
  if (pinned) return {};
  const kernels::FramebufferView to = framebuffer.view();
  const auto* from = static_cast<const std::byte*>(band.host_planes.data());
  for_each_plane(framebuffer, rows,
                 [&](const AovInfo& info, std::uint64_t offset, std::uint64_t row) {
                   auto* plane = static_cast<std::byte*>(to.planes[static_cast<int>(info.aov)]);
                   std::memcpy(plane + row * band.first_row, from + offset, row * rows);
                 });
  return {};
}

util::Result<TraceStats> CudaRenderer::render(const kernels::RayCamera& camera,
                                              const Settings& settings, Framebuffer& framebuffer) {
  const auto start_time = std::chrono::steady_clock::now();
  AovSet geometry = framebuffer.aovs();
  geometry.reset(static_cast<std::size_t>(Aov::beauty));
  const bool beauty = framebuffer.aovs().test(static_cast<std::size_t>(Aov::beauty));
  if (beauty && settings.params.spp == 0) {
    return Error{Exit::usage, "", "beauty needs at least one sample a pixel (--spp)", "", ""};
  }
  if (Status s = kernels::cuda::select_device(device_); !s.ok()) return cuda_error(s);
  const util::Result<std::uint32_t> rows = choose_rows(framebuffer);
  if (!rows) return rows.error();
  kernels::cuda::InstancedView view{{scene_.view(),
                                     camera,
                                     settings.params,
                                     {},
                                     geometry.any(),
                                     beauty,
                                     geometry.test(static_cast<std::size_t>(Aov::motion)),
                                     {}},
                                    scene_.view()};
  if (view.has_motion && settings.next) {
    const util::Result<kernels::MotionView> motion = upload_motion(camera, *settings.next);
    if (!motion) return motion.error();
    view.motion = *motion;
  }
  const bool pinned = pin_when_reused(device_, framebuffer);
  TraceStats stats;
  util::Result<void> result;
  std::size_t turn = 0;
  for (std::uint32_t row = 0; row < framebuffer.height() && result; row += *rows, ++turn) {
    if (settings.cancel != nullptr && *settings.cancel) {
      result = Error{Exit::internal, "CANCELLED", "the render was cancelled", "", ""};
      break;
    }
    Band& band = bands_[turn % bands_.size()];
    result = finish(band, framebuffer, pinned, stats);
    if (!result) break;
    band.first_row = row;
    band.rows = std::min(*rows, framebuffer.height() - row);
    if (Status s = start(band, view, framebuffer, pinned); !s.ok()) result = cuda_error(s);
    if (settings.progress) settings.progress(static_cast<double>(row) / framebuffer.height());
  }
  // Whatever happened, nothing may still be writing to the bands or the planes when this returns.
  for (std::size_t i = 0; i < bands_.size(); ++i) {
    Band& band = bands_[(turn + i) % bands_.size()];
    if (result) result = finish(band, framebuffer, pinned, stats);
    if (!result) kernels::cuda::synchronize(band.stream.get());
    band.rows = 0;
  }
  if (!result) return result.error();
  if (settings.progress) settings.progress(1.0);
  const std::uint64_t pixels = std::uint64_t{framebuffer.width()} * framebuffer.height();
  stats.camera_rays = geometry.any() ? pixels : 0;
  stats.device = device_name_;
  stats.upload_seconds = scene_.upload_seconds();
  stats.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();
  return stats;
}

}  // namespace octrace::render
