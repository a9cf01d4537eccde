#include "tests/bench/ray_gpu.h"

#include "tests/bench/gpu_call.h"

namespace octrace::bench {

namespace {

using kernels::Hit;
using kernels::Ray;
namespace cuda = kernels::cuda;

class CudaRays final : public RayGpu {
 public:
  explicit CudaRays(std::string name) : name_(std::move(name)) {}

  util::Result<void> upload_octree(const octree::Octree& octree) {
    CudaCalls calls;
    calls.then([&] { return upload(nodes_, octree.nodes); })
        .then([&] { return upload(triangles_, octree.triangles); })
        .then([&] { return report_.reserve(sizeof(cuda::Report)); })
        .then([&] { return cuda::synchronize(nullptr); });
    if (!calls.ok()) return calls.error();
    view_ = {span_of(nodes_, octree.nodes), span_of(triangles_, octree.triangles), octree.cut};
    params_.cull = 0;
    params_.alpha = 0;
    return {};
  }

  std::string name() const override { return name_; }

  util::Result<void> load(const std::vector<Ray>& rays) override {
    count_ = rays.size();
    CudaCalls calls;
    calls.then([&] { return upload(rays_, rays); })
        .then([&] { return hits_.reserve(std::max<std::uint64_t>(1, count_) * sizeof(Hit)); })
        .then([&] { return cuda::synchronize(nullptr); });
    return calls.ok() ? util::Result<void>() : calls.error();
  }

  util::Result<std::vector<Hit>> trace(bool any_hit) override {
    std::vector<Hit> hits(count_);
    CudaCalls calls;
    calls.then([&] { return cuda::clear(hits_.data(), count_ * sizeof(Hit), nullptr); });
    if (!calls.ok()) return calls.error();
    if (util::Result<double> timed = time(any_hit); !timed) return timed.error();
    calls
        .then([&] {
          return cuda::copy_to_host(hits.data(), hits_.data(), count_ * sizeof(Hit), nullptr);
        })
        .then([&] { return cuda::synchronize(nullptr); });
    if (!calls.ok()) return calls.error();
    return hits;
  }

  util::Result<double> time(bool any_hit) override {
    float milliseconds = 0.0f;
    auto* report = static_cast<cuda::Report*>(report_.data());
    CudaCalls calls;
    calls.then([&] { return cuda::clear(report, sizeof *report, nullptr); })
        .then([&] { return cuda::synchronize(nullptr); })
        .then([&] {
          return cuda::time_rays(view_, params_, static_cast<const Ray*>(rays_.data()),
                                 static_cast<Hit*>(hits_.data()), count_, any_hit, report,
                                 &milliseconds);
        });
    if (!calls.ok()) return calls.error();
    if (util::Result<void> checked = check_report(report_); !checked) return checked.error();
    return milliseconds * 1e-3;
  }

 private:
  std::string name_;
  render::DeviceMemory nodes_, triangles_, rays_, hits_, report_;
  kernels::OctreeView view_;
  kernels::RenderParams params_;
  std::uint64_t count_ = 0;
};

}  // namespace

util::Result<std::unique_ptr<RayGpu>> make_ray_gpu(const octree::Octree& octree, int device) {
  util::Result<std::string> name = use_device(device);
  if (!name) return name.error();
  auto gpu = std::make_unique<CudaRays>(*name);
  if (util::Result<void> uploaded = gpu->upload_octree(octree); !uploaded) return uploaded.error();
  return std::unique_ptr<RayGpu>(std::move(gpu));
}

}  // namespace octrace::bench
