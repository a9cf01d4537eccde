#include "tests/bench/octrace_tracer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "kernels/cpu/intersect.h"
#include "tests/bench/clock.h"

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
                 const octree::WideOctree& wide, const std::vector<kernels::Ray>& rays,
                 bool any_hit, bool coherent, unsigned threads, std::vector<kernels::Hit>* hits) {
  kernels::SceneView view = scene.view();
  view.octree = octree.view();
  kernels::RenderParams params;
  params.cull = 0;
  params.alpha = 0;
  const kernels::CpuTracer tracer(wide.view());
  std::vector<kernels::Hit> found(any_hit ? 0 : rays.size());
  std::vector<float> transmittances(any_hit ? rays.size() : 0);
  constexpr std::size_t kGrain = 4096;
  const double start = seconds_now(threads);
  tbb::task_arena(static_cast<int>(threads)).execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays.size(), kGrain),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        const std::size_t first = range.begin();
                        const auto count = static_cast<std::uint32_t>(range.size());
                        if (any_hit) {
                          tracer.transmittance(view, params, &rays[first], count,
                                               &transmittances[first]);
                        } else if (coherent) {
                          tracer.closest_coherent(view, params, &rays[first], count, &found[first]);
                        } else {
                          tracer.closest(view, params, &rays[first], count, &found[first]);
                        }
                      });
  });
  const double seconds = seconds_now(threads) - start;
  if (any_hit && hits != nullptr) {
    found.resize(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i)
      found[i].triangle = transmittances[i] > 0.0f ? kernels::kNone : 0;
  }
  if (hits != nullptr) *hits = std::move(found);
  return seconds;
}

}  // namespace octrace::bench
