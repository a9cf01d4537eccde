#include "tests/bench/paper_gpu.h"

#include <chrono>

#include "backend/render/device_scene.h"
#include "tests/bench/gpu_call.h"

namespace octrace::bench {

namespace {

using kernels::Hit;
using kernels::RayCamera;
namespace cuda = kernels::cuda;

class CudaEvent {
 public:
  CudaEvent() = default;
  CudaEvent(const CudaEvent&) = delete;
  CudaEvent& operator=(const CudaEvent&) = delete;
  ~CudaEvent() {
    if (event_ != nullptr) cuda::destroy_event(event_);
  }
  cuda::Status create() { return cuda::create_event(&event_); }
  cuda::Event get() const { return event_; }

 private:
  cuda::Event event_ = nullptr;
};

class CudaPaper final : public PaperGpu {
 public:
  CudaPaper(std::string name, int width, int height)
      : name_(std::move(name)), width_(width), height_(height) {}

  util::Result<void> prepare(const scene::Scene& scene, const octree::Octree& octree,
                             const SeedTree& seed) {
    const std::uint64_t pixels = static_cast<std::uint64_t>(width_) * height_;
    CudaCalls calls;
    calls.then([&] { return scene_.upload(scene, octree); })
        .then([&] { return upload(nodes_, seed.nodes); })
        .then([&] { return upload(ids_, seed.ids); })
        .then([&] { return hits_.reserve(pixels * sizeof(Hit)); })
        .then([&] { return planes_.reserve(pixels * 2 * sizeof(float)); })
        .then([&] { return host_.reserve(pixels * sizeof(Hit)); })
        .then([&] { return report_.reserve(sizeof(cuda::Report)); })
        .then([&] { return stream_.create(); })
        .then([&] { return start_.create(); })
        .then([&] { return stop_.create(); })
        .then([&] { return cuda::synchronize(nullptr); });
    if (!calls.ok()) return calls.error();
    seed_ = {span_of(nodes_, seed.nodes), span_of(ids_, seed.ids), scene_.view().triangles,
             scene_.view().positions};
    return {};
  }

  std::string name() const override { return name_; }

  util::Result<Seconds> trace_seed(const RayCamera& camera, std::uint32_t band_rows,
                                   std::vector<Hit>* hits) override {
    const cuda::SeedImage image{seed_, camera, static_cast<Hit*>(hits_.data()), width_, height_};
    util::Result<Seconds> seconds =
        measure([&] { return cuda::launch_seed(image, band_rows, report(), stream_.get()); },
                hits_.data(), pixels() * sizeof(Hit));
    if (seconds && hits != nullptr) {
      const Hit* found = static_cast<const Hit*>(host_.data());
      hits->assign(found, found + pixels());
    }
    return seconds;
  }

  util::Result<Seconds> trace_fast(const RayCamera& camera, std::vector<Hit>* hits) override {
    cuda::View view{};
    view.scene = scene_.view();
    view.camera = camera;
    view.params.cull = 0;
    view.target.width = width_;
    view.target.height = height_;
    auto* depth = static_cast<float*>(planes_.data());
    view.target.planes[static_cast<int>(kernels::Aov::depth)] = depth;
    view.target.planes[static_cast<int>(kernels::Aov::primitive_id)] = depth + pixels();
    view.geometry = true;
    util::Result<Seconds> seconds =
        measure([&] { return cuda::launch_view(view, report(), stream_.get()); }, depth,
                pixels() * 2 * sizeof(float));
    if (seconds && hits != nullptr) {
      const float* t = static_cast<const float*>(host_.data());
      const auto* id = static_cast<const std::uint32_t*>(host_.data()) + pixels();
      hits->resize(pixels());
      // 0 is the background, else the index + 1: one less makes it kNone or the index.
      for (std::uint64_t i = 0; i < pixels(); ++i) (*hits)[i] = {t[i], 0.0f, 0.0f, id[i] - 1u};
    }
    return seconds;
  }

 private:
  std::uint64_t pixels() const { return static_cast<std::uint64_t>(width_) * height_; }
  cuda::Report* report() const { return static_cast<cuda::Report*>(report_.data()); }

  template <class Launch>
  util::Result<Seconds> measure(Launch&& launch, const void* result, std::uint64_t bytes) {
    float milliseconds = 0.0f;
    CudaCalls calls;
    calls.then([&] { return cuda::clear(report(), sizeof(cuda::Report), stream_.get()); })
        .then([&] { return cuda::synchronize(stream_.get()); });
    const auto begin = std::chrono::steady_clock::now();
    calls.then([&] { return cuda::record_event(start_.get(), stream_.get()); })
        .then(launch)
        .then([&] { return cuda::record_event(stop_.get(), stream_.get()); })
        .then([&] { return cuda::copy_to_host(host_.data(), result, bytes, stream_.get()); })
        .then([&] { return cuda::synchronize(stream_.get()); });
    const double image =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    calls.then([&] { return cuda::elapsed(start_.get(), stop_.get(), &milliseconds); });
    if (!calls.ok()) return calls.error();
    if (util::Result<void> checked = check_report(report_); !checked) return checked.error();
    return Seconds{image, milliseconds * 1e-3};
  }

  std::string name_;
  std::uint32_t width_, height_;
  render::DeviceScene scene_;
  render::DeviceMemory nodes_, ids_, hits_, planes_, report_;
  render::PinnedMemory host_;
  render::DeviceStream stream_;
  CudaEvent start_, stop_;
  kernels::SeedView seed_;
};

}  // namespace

util::Result<std::unique_ptr<PaperGpu>> make_paper_gpu(const scene::Scene& scene,
                                                       const octree::Octree& octree,
                                                       const SeedTree& seed, int width, int height,
                                                       int device) {
  util::Result<std::string> name = use_device(device);
  if (!name) return name.error();
  auto gpu = std::make_unique<CudaPaper>(*name, width, height);
  if (util::Result<void> ready = gpu->prepare(scene, octree, seed); !ready) return ready.error();
  return std::unique_ptr<PaperGpu>(std::move(gpu));
}

}  // namespace octrace::bench
