#include "tests/bench/octrace_tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>

#include "kernels/cpu/intersect.h"

namespace octrace::bench {

namespace {

struct CountingChildTest {
  std::uint64_t* nodes;
  std::uint64_t* triangles;
  kernels::NodeVisit operator()(const kernels::Node& node, const kernels::SlabRay& ray, float tmin,
                                float tmax) const {
    const kernels::NodeVisit visit = kernels::ScalarChildTest{}(node, ray, tmin, tmax);
    ++*nodes;
    *triangles +=
        static_cast<std::uint64_t>(kernels::count_bits(visit.hits & kernels::kTriangleBits));
    return visit;
  }
};

}  // namespace

Work count_work(const scene::Scene& scene, const octree::Octree& octree,
                const std::vector<kernels::Ray>& rays, bool any_hit) {
  kernels::SceneView view = scene.view();
  view.octree = octree.view();
  kernels::RenderParams params;
  params.cull = 0;
  params.alpha = 0;
  std::uint64_t nodes = 0, triangles = 0;
  const CountingChildTest test{&nodes, &triangles};
  for (const kernels::Ray& ray : rays) {
    kernels::Hit hit;
    float transmittance;
    if (any_hit) {
      kernels::shadow_transmittance(view, params, ray, test, &transmittance);
    } else {
      kernels::closest_hit(view, params, ray, test, &hit);
    }
  }
  const double count = static_cast<double>(std::max<std::size_t>(rays.size(), 1));
  return {static_cast<double>(nodes) / count, static_cast<double>(triangles) / count};
}

double trace_cpu(const scene::Scene& scene, const octree::Octree& octree,
                 const std::vector<kernels::Ray>& rays, bool any_hit, unsigned threads,
                 std::vector<kernels::Hit>* hits) {
  kernels::SceneView view = scene.view();
  view.octree = octree.view();
  kernels::RenderParams params;
  params.cull = 0;
  params.alpha = 0;
  const kernels::CpuTracer tracer;
  std::vector<kernels::Hit> found(rays.size());
  constexpr std::size_t kGrain = 4096;
  const auto start = std::chrono::steady_clock::now();
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kGrain),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        for (std::size_t i = range.begin(); i < range.end(); ++i) {
                          if (any_hit) {
                            float transmittance = 1.0f;
                            tracer.transmittance(view, params, rays[i], &transmittance);
                            found[i].triangle = transmittance > 0.0f ? kernels::kNone : 0;
                          } else {
                            tracer.closest(view, params, rays[i], &found[i]);
                          }
                        }
                      });
  });
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (hits != nullptr) *hits = std::move(found);
  return seconds;
}

}  // namespace octrace::bench
