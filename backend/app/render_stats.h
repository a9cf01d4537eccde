// The figures of one render: the file of --stats and the line that ends a run.
#pragma once

#include <string>
#include <vector>

#include "backend/batch/scene_session.h"
#include "backend/render/renderer.h"
#include "backend/util/process.h"
#include "backend/util/result.h"

namespace octrace::app {

struct RenderStats {
  util::Timer total;  // since the command line was read
  render::TraceStats trace;
  double trace_ms = 0.0, write_ms = 0.0;
  std::uint32_t width = 0, height = 0, spp = 0;
  std::string camera;
  octree::Builder builder = octree::Builder::sah;
  std::vector<std::string> outputs;

  std::uint64_t rays() const { return trace.camera_rays + trace.beauty_rays + trace.shadow_rays; }
  double mrays_per_s() const {
    return trace.seconds > 0.0 ? static_cast<double>(rays()) / trace.seconds * 1e-6 : 0.0;
  }
};

inline constexpr const char* kStandardOutput = "-";

// `path`: a file, or kStandardOutput.
util::Result<void> write_stats(const std::string& path, const RenderStats& stats,
                               const batch::SceneSession& session);
std::string summary(const RenderStats& stats, const batch::SceneSession& session);

}  // namespace octrace::app
