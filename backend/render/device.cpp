#include "backend/render/device.h"

#include <fmt/format.h>

#include <charconv>

#include "backend/util/log.h"
#if defined(OCTRACE_HAVE_CUDA)
#include "backend/render/cuda_renderer.h"
#endif

namespace octrace::render {

namespace {

void say_fallback(const DeviceChoice& choice, const std::string& why) {
  const std::string text = fmt::format("{}; rendering on the CPU", why);
  if (choice.kind == DeviceKind::cuda) {
    util::log_warning(text);
  } else {
    util::log_verbose(text);
  }
}

#if defined(OCTRACE_HAVE_CUDA)

// The GPU as long as it has the memory, then the CPU.
class CudaOrCpu final : public Renderer {
 public:
  CudaOrCpu(const scene::Scene& scene, const octree::Octree& octree,
            std::unique_ptr<CudaRenderer> cuda)
      : scene_(scene), octree_(octree), cuda_(std::move(cuda)) {}

  util::Result<TraceStats> render(const kernels::RayCamera& camera, const Settings& settings,
                                  Framebuffer& framebuffer) override {
    if (cuda_) {
      util::Result<TraceStats> result = cuda_->render(camera, settings, framebuffer);
      if (result || result.error().exit != util::Exit::limit) return result;
      util::log_warning(result.error().message + "; rendering on the CPU");
      cuda_.reset();
    }
    if (!cpu_) cpu_ = make_cpu_renderer(scene_, octree_);
    return cpu_->render(camera, settings, framebuffer);
  }

  util::Result<void> refresh(const scene::SceneChanges& changes) override {
    if (cpu_) return cpu_->refresh(changes);
    util::Result<void> result = cuda_->refresh(changes);
    if (result || result.error().exit != util::Exit::limit) return result;
    util::log_warning(result.error().message + "; rendering on the CPU");
    cuda_.reset();
    cpu_ = make_cpu_renderer(scene_, octree_);
    return {};
  }

 private:
  const scene::Scene& scene_;
  const octree::Octree& octree_;
  std::unique_ptr<CudaRenderer> cuda_;
  std::unique_ptr<Renderer> cpu_;
};

#endif

}  // namespace

util::Result<DeviceChoice> parse_device(std::string_view text) {
  if (text == "auto") return DeviceChoice{};
  if (text == "cpu") return DeviceChoice{DeviceKind::cpu, 0};
  if (text == "cuda") return DeviceChoice{DeviceKind::cuda, 0};
  constexpr std::string_view kPrefix = "cuda:";
  int index = -1;
  if (text.starts_with(kPrefix)) {
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data() + kPrefix.size(), end, index);
    if (error != std::errc() || stop != end) index = -1;
  }
  if (index >= 0) return DeviceChoice{DeviceKind::cuda, index};
  return util::Error{util::Exit::usage, "",
                     fmt::format("--device {}: expected auto, cpu, cuda or cuda:N", text), "", ""};
}

#if defined(OCTRACE_HAVE_CUDA)

std::string cuda_unavailable(int index) {
  int count = 0;
  const kernels::cuda::Status status = kernels::cuda::count_devices(&count);
  if (!status.ok()) return fmt::format("no usable NVIDIA driver or GPU: {}", status.text);
  if (count == 0) return "no NVIDIA GPU";
  if (index >= count) return fmt::format("cuda:{} does not exist, there are {} GPUs", index, count);
  kernels::cuda::Device device{};
  const kernels::cuda::Status query = kernels::cuda::query_device(index, &device);
  if (!query.ok()) return fmt::format("cuda:{}: {}", index, query.text);
  using kernels::cuda::kOldestMajor, kernels::cuda::kOldestMinor;
  if (device.major < kOldestMajor ||
      (device.major == kOldestMajor && device.minor < kOldestMinor)) {
    return fmt::format("{} has compute capability {}.{}, at least {}.{} is needed", device.name,
                       device.major, device.minor, kOldestMajor, kOldestMinor);
  }
  return "";
}

std::unique_ptr<Renderer> make_renderer(const scene::Scene& scene, const octree::Octree& octree,
                                        const DeviceChoice& choice) {
  if (choice.kind == DeviceKind::cpu) return make_cpu_renderer(scene, octree);
  const std::string unavailable = cuda_unavailable(choice.index);
  if (unavailable.empty()) {
    util::Result<std::unique_ptr<CudaRenderer>> cuda =
        CudaRenderer::create(scene, octree, choice.index);
    if (cuda) return std::make_unique<CudaOrCpu>(scene, octree, std::move(*cuda));
    util::log_warning(cuda.error().message + "; rendering on the CPU");
  } else {
    say_fallback(choice, unavailable);
  }
  return make_cpu_renderer(scene, octree);
}

#else

std::string cuda_unavailable(int) { return "this octrace was built without CUDA"; }

std::unique_ptr<Renderer> make_renderer(const scene::Scene& scene, const octree::Octree& octree,
                                        const DeviceChoice& choice) {
  if (choice.kind != DeviceKind::cpu) say_fallback(choice, cuda_unavailable(choice.index));
  return make_cpu_renderer(scene, octree);
}

#endif

}  // namespace octrace::render
