#include "exporters/gltf/gltf.h"

#include "backend/util/atomic_file.h"
#include "exporters/gltf/parts.h"

namespace octrace::exporters {

util::Result<GltfFile> write_gltf(const scene::Scene& scene, const std::string& path) {
  GltfJob job{scene, path_parts(path).folder, {}, {}};
  auto& json = job.glb.json();
  json["asset"] = {{"version", "2.0"}, {"generator", "octrace"}};
  if (auto done = append_materials(job); !done) return done.error();
  append_nodes(job);
  const auto bytes = job.glb.finish(path);
  if (!bytes) return bytes.error();
  if (auto written = util::write_file(path, *bytes); !written) return written.error();
  return GltfFile{bytes->size(), std::move(job.notes)};
}

}  // namespace octrace::exporters
