#include "tests/bench/build_gpu.h"

#include "backend/render/device_builder.h"

namespace octrace::bench {

util::Result<GpuBuild> build_on_gpu(const scene::Scene& scene, int device, int repeats) {
  const std::vector<std::uint32_t> flags = octree::geometry_flags(scene);
  render::DeviceBuilder builder;
  if (util::Result<void> loaded =
          builder.load({scene.positions, scene.triangles, scene.triangle_geometry, flags}, device);
      !loaded) {
    return loaded.error();
  }
  GpuBuild result;
  for (int i = 0; i <= repeats; ++i) {
    const util::Result<double> seconds = builder.build();
    if (!seconds) return seconds.error();
    if (i > 0) result.seconds.push_back(*seconds);
  }
  util::Result<octree::Octree> octree = builder.download();
  if (!octree) return octree.error();
  result.octree = std::move(*octree);
  return result;
}

}  // namespace octrace::bench
