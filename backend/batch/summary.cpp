#include "backend/batch/summary.h"

#include <fmt/format.h>

#include "backend/util/process.h"
#include "backend/util/version.h"

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

ordered_json failure_json(const Plan& plan, const Failure& failure) {
  ordered_json json;
  if (failure.view) {
    const View view = plan.view(*failure.view);
    json = {{"view", view.index}, {"camera", plan.camera_name(view)}, {"frame", view.frame}};
  }
  json["scene"] = plan.job().scenes[failure.scene].path;
  json["scene_index"] = failure.scene;
  json["views"] = failure.views;
  json["exit"] = static_cast<int>(failure.error.exit);
  json["error"] = failure.error.to_string();
  return json;
}

}  // namespace

ordered_json summary_json(const Plan& plan, const RunOptions& options, const RunSummary& summary) {
  const Standing& standing = summary.standing;
  ordered_json json;
  json["octrace"] = util::version();
  json["job"] = plan.job().file;
  json["shard"] = {options.shard.index, options.shard.count};
  json["views"] = standing.views;
  json["done"] = standing.before + standing.done;
  json["done_by_this_run"] = standing.done;
  json["failed"] = standing.failed;
  json["left"] = standing.left();
  json["interrupted"] = summary.interrupted;
  if (summary.fatal) json["stopped_by"] = summary.fatal->to_string();
  json["failures"] = ordered_json::array();
  for (const Failure& failure : summary.failures) {
    json["failures"].push_back(failure_json(plan, failure));
  }
  json["seconds"] = standing.seconds;
  json["views_per_s"] = standing.views_per_s();
  json["scenes_loaded"] = summary.scenes_loaded;
  // Of the tracing thread, and of all writers together.
  json["ms"] = {{"load", summary.load_ms},
                {"trace", summary.trace_ms},
                {"wait_for_writers", summary.wait_ms},
                {"encode", summary.encode_ms},
                {"flush", summary.flush_ms}};
  json["device"] = summary.device;
  json["peak_rss_bytes"] = util::peak_resident_bytes();
  return json;
}

std::string failure_text(const Plan& plan, const Failure& failure) {
  const JobScene& scene = plan.job().scenes[failure.scene];
  if (!failure.view) {
    return fmt::format("scene {} ({}), {} views: {}", failure.scene, scene.name, failure.views,
                       failure.error.to_string());
  }
  const View view = plan.view(*failure.view);
  return fmt::format("view {} (scene {}, camera {}, frame {}): {}", view.index, scene.name,
                     plan.camera_name(view), view.frame, failure.error.to_string());
}

}  // namespace octrace::batch
