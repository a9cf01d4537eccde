#include <fmt/format.h>

#include <chrono>
#include <fstream>

#include "backend/octree/octree.h"
#include "backend/render/device.h"
#include "backend/scene/builtin.h"
#include "kernels/cpu/intersect.h"
#include "tests/bench/hits.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_gpu.h"
#include "tests/bench/seed_tree.h"

namespace octrace::bench {

namespace {

using kernels::Hit;
using kernels::RayCamera;
using kernels::TraceStatus;

util::Error disagreement(const char* who, int z, double share) {
  return {util::Exit::different, "",
          fmt::format("{} agree on only {:.4f} % of the pixels at Z = {}", who, 100.0 * share, z),
          "", ""};
}

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(": ") + 2);
  }
  return "unknown CPU";
}

// Both CPU sides do what a thread of the GPU does, pixel after pixel, on this thread.
class CpuSides {
 public:
  CpuSides(const scene::Scene& scene, const octree::Octree& octree, const SeedTree& seed, int width,
           int height)
      : width_(width),
        height_(height),
        seed_(seed.view(scene.triangles, scene.positions)),
        fast_(scene.view()),
        hits_(static_cast<std::size_t>(width) * height) {
    fast_.octree = octree.view();
    params_.cull = 0;
    params_.alpha = 0;
  }

  // Seconds; negative where a traversal failed.
  double trace_seed(const RayCamera& camera) {
    return each_pixel(camera, [&](const kernels::Ray& ray, Hit* hit) {
      return kernels::seed_trace(seed_, ray, hit);
    });
  }
  double trace_fast(const RayCamera& camera) {
    return each_pixel(camera, [&](const kernels::Ray& ray, Hit* hit) {
      return tracer_.closest(fast_, params_, ray, hit);
    });
  }

  const std::vector<Hit>& hits() const { return hits_; }  // of the last image
  const char* instruction_set() const { return tracer_.instruction_set(); }

 private:
  template <class Trace>
  double each_pixel(const RayCamera& camera, const Trace& trace) {
    bool ok = true;
    Hit* hit = hits_.data();
    const auto start = std::chrono::steady_clock::now();
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const kernels::Ray ray =
            camera_ray(camera, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        ok &= trace(ray, hit++) == TraceStatus::ok;
      }
    }
    const auto stop = std::chrono::steady_clock::now();
    return ok ? std::chrono::duration<double>(stop - start).count() : -1.0;
  }

  int width_, height_;
  kernels::SeedView seed_;
  kernels::SceneView fast_;
  kernels::RenderParams params_;
  kernels::CpuTracer tracer_;
  std::vector<Hit> hits_;
};

class Experiment {
 public:
  Experiment(const PaperOptions& options, CpuSides& cpu, PaperGpu* gpu)
      : options_(options), cpu_(cpu), gpu_(gpu) {}

  util::Result<PaperRow> run(const RayCamera& camera, int z) {
    PaperRow row;
    row.z = z;
    if (util::Result<void> compared = compare(camera, row); !compared) return compared.error();
    for (int i = 0; i < options_.repeats; ++i) {  // turn about, so that all see the same machine
      row.times.seed_cpu.push_back(cpu_.trace_seed(camera));
      row.times.fast_cpu.push_back(cpu_.trace_fast(camera));
      if (gpu_ == nullptr) continue;
      const util::Result<PaperGpu::Seconds> seed =
          gpu_->trace_seed(camera, options_.band_rows, nullptr);
      if (!seed) return seed.error();
      const util::Result<PaperGpu::Seconds> fast = gpu_->trace_fast(camera, nullptr);
      if (!fast) return fast.error();
      row.times.seed_gpu.push_back(seed->image);
      row.times.seed_kernels.push_back(seed->kernels);
      row.times.fast_gpu.push_back(fast->image);
      row.times.fast_kernels.push_back(fast->kernels);
    }
    return row;
  }

 private:
  // Warms up as well.
  util::Result<void> compare(const RayCamera& camera, PaperRow& row) {
    const bool seed_ok = cpu_.trace_seed(camera) >= 0.0;
    const std::vector<Hit> seed = cpu_.hits();
    const bool fast_ok = cpu_.trace_fast(camera) >= 0.0;
    const std::vector<Hit>& fast = cpu_.hits();
    if (!seed_ok || !fast_ok) {
      return util::Error{util::Exit::internal, "", "a traversal overflowed its stack", "", ""};
    }
    std::size_t hits = 0;
    for (const Hit& hit : fast) hits += hit.valid();
    row.hit_share = static_cast<double>(hits) / static_cast<double>(fast.size());
    row.cpu_agreement = agreement(seed, fast, false);
    if (row.cpu_agreement < kLeastAgreement) {
      return disagreement("the seed's hits and octrace's", row.z, row.cpu_agreement);
    }
    return gpu_ != nullptr ? compare_gpu(camera, seed, fast, row) : util::Result<void>();
  }

  util::Result<void> compare_gpu(const RayCamera& camera, const std::vector<Hit>& seed,
                                 const std::vector<Hit>& fast, PaperRow& row) {
    std::vector<Hit> gpu_seed, gpu_fast;
    if (auto traced = gpu_->trace_seed(camera, options_.band_rows, &gpu_seed); !traced) {
      return traced.error();
    }
    if (auto traced = gpu_->trace_fast(camera, &gpu_fast); !traced) return traced.error();
    row.seed_differing = differing_hits(seed, gpu_seed, false);
    row.gpu_agreement = agreement(gpu_seed, fast, false);
    std::vector<Hit> fast_depth = fast;  // the planes that the GPU's view fills hold no u and v
    for (Hit& hit : fast_depth) hit.u = hit.v = 0.0f;
    row.fast_differing = differing_hits(fast_depth, gpu_fast, false);
    if (*row.gpu_agreement < kLeastAgreement) {
      return disagreement("the seed's hits on the GPU and octrace's", row.z, *row.gpu_agreement);
    }
    const double fast_agreement = agreement(gpu_fast, fast, false);
    if (fast_agreement < kLeastAgreement) {
      return disagreement("octrace's hits on the GPU and on the CPU", row.z, fast_agreement);
    }
    return {};
  }

  const PaperOptions& options_;
  CpuSides& cpu_;
  PaperGpu* gpu_;
};

const scene::Camera* camera_named(const scene::Scene& scene, const std::string& name) {
  for (const scene::Camera& camera : scene.cameras) {
    if (camera.name == name) return &camera;
  }
  return nullptr;
}

}  // namespace

util::Result<PaperResult> run_paper(const PaperOptions& options) {
  const scene::Scene scene = scene::make_paper_scene();
  const util::Result<octree::Octree> octree = octree::build(scene, {});
  if (!octree) return octree.error();
  const SeedTree seed = build_seed_tree(scene.positions, scene.triangles, options.threshold);
  CpuSides cpu(scene, *octree, seed, options.width, options.height);

  PaperResult result;
  result.options = options;
  result.vertices = scene.positions.size();
  result.triangles = scene.triangles.size();
  result.seed_nodes = seed.nodes.size();
  result.seed_depth = seed.depth;
  result.fast_nodes = octree->nodes.size();
  result.cpu = cpu_name();
  result.instruction_set = cpu.instruction_set();
  result.gpu_missing =
      options.gpu ? render::cuda_unavailable(options.gpu_index) : "--device cpu was asked for";
  std::unique_ptr<PaperGpu> gpu;
  if (result.gpu_missing.empty()) {
    auto made =
        make_paper_gpu(scene, *octree, seed, options.width, options.height, options.gpu_index);
    if (!made) return made.error();
    gpu = std::move(*made);
    result.gpu = gpu->name();
  }
  Experiment experiment(options, cpu, gpu.get());
  for (const PaperFigures& figures : kPaperTable) {
    const scene::Camera* camera = camera_named(scene, fmt::format("Z{}", figures.z));
    if (camera == nullptr) {
      return util::Error{util::Exit::internal, "",
                         fmt::format("builtin:paper has no camera Z{}", figures.z), "", ""};
    }
    util::Result<PaperRow> row =
        experiment.run(scene::make_ray_camera(*camera, options.width, options.height), figures.z);
    if (!row) return row.error();
    result.rows.push_back(std::move(*row));
  }
  return result;
}

std::vector<double> ratios(const std::vector<double>& slow, const std::vector<double>& fast) {
  std::vector<double> result;
  for (std::size_t i = 0; i < std::min(slow.size(), fast.size()); ++i) {
    result.push_back(slow[i] / fast[i]);
  }
  return result;
}

}  // namespace octrace::bench
