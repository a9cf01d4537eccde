#include "backend/app/render_stats.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "backend/app/octree_json.h"
#include "backend/scene/instances.h"
#include "backend/util/atomic_file.h"
#include "backend/util/version.h"

namespace octrace::app {

using nlohmann::ordered_json;

util::Result<void> write_stats(const std::string& path, const RenderStats& stats,
                               const batch::SceneSession& session) {
  const scene::Scene& scene = session.scene;
  ordered_json json;
  json["octrace"] = util::version();
  json["device"] = stats.trace.device;
  json["scene"] = {{"source", session.source},
                   {"triangles", scene.triangles.size()},
                   {"vertices", scene.positions.size()},
                   {"geometries", scene.geometries.size()},
                   {"materials", scene.materials.size()},
                   {"textures", scene.textures.size()},
                   {"lights", scene.lights.size()},
                   {"cameras", scene.cameras.size()},
                   {"instances", scene.instancing ? scene.instancing->instances.size() : 0},
                   {"bytes", scene.bytes()}};
  json["image"] = {{"width", stats.width},
                   {"height", stats.height},
                   {"spp", stats.spp},
                   {"camera", stats.camera},
                   {"outputs", stats.outputs}};
  json["rays"] = {{"camera", stats.trace.camera_rays},
                  {"beauty", stats.trace.beauty_rays},
                  {"shadow", stats.trace.shadow_rays},
                  {"total", stats.rays()}};
  json["mrays_per_s"] = stats.mrays_per_s();
  json["ms"] = {{"load", session.load_ms},
                {"build", session.build_ms},
                {"verify", session.verify_ms},
                {"trace", stats.trace_ms},
                {"upload", 1e3 * stats.trace.upload_seconds},
                {"kernel", 1e3 * stats.trace.kernel_seconds},
                {"download", 1e3 * stats.trace.download_seconds},
                {"write", stats.write_ms},
                {"total", stats.total.milliseconds()}};
  json["octree"] = octree_json(octree::statistics(session.octree));
  json["octree"]["builder"] = octree::name_of(stats.builder);
  json["octree"]["walk_bytes"] = stats.trace.walk_bytes;
  json["peak_rss_bytes"] = util::peak_resident_bytes();
  const std::string text = json.dump(2) + "\n";
  if (path != kStandardOutput) return util::write_file(path, text);
  fmt::print("{}", text);
  return {};
}

namespace {

std::string instances_text(const scene::Scene& scene) {
  if (!scene.instancing) return "";
  return fmt::format(" and {} instances of {} triangles", scene.instancing->instances.size(),
                     scene.instancing->meshes->triangles.size());
}

}  // namespace

std::string summary(const RenderStats& stats, const batch::SceneSession& session) {
  std::string names;
  for (const std::string& output : stats.outputs) {
    names += (names.empty() ? "" : ", ") + output;
  }
  return fmt::format(
      "{}: {} triangles{}, load {:.0f} ms, build {:.0f} ms, trace {:.0f} ms ({:.1f} Mrays/s) on "
      "{}, "
      "write {:.0f} ms",
      names, session.scene.triangles.size(), instances_text(session.scene), session.load_ms,
      session.build_ms, stats.trace_ms, stats.mrays_per_s(), stats.trace.device, stats.write_ms);
}

}  // namespace octrace::app
