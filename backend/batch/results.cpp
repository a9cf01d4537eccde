#include "backend/batch/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "backend/batch/annotations_file.h"
#include "backend/batch/cameras_file.h"
#include "backend/batch/journal_index.h"
#include "backend/batch/objects_file.h"
#include "backend/batch/state.h"
#include "backend/util/atomic_file.h"
#include "backend/util/grouped_commit.h"
#include "backend/util/version.h"

namespace octrace::batch {

namespace {

using nlohmann::ordered_json;
using util::Result;

// What a first reading of all journals leaves.
struct Gathered {
  JournalIndex index;
  std::vector<bool> packed;  // by view, where the job has packs
  SceneLines scenes;
  std::map<std::int64_t, JobFailure> failures;  // by view, or -1 - scene
  std::uint64_t journals = 0;
  double seconds = 0.0, longest = 0.0;

  bool has(std::uint64_t view) const { return packed.empty() ? index.has(view) : packed[view]; }
};

bool files_are_there(const std::string& folder, const ordered_json& line) {
  for (const ordered_json& file : line.at("files")) {
    std::error_code error;
    const auto bytes =
        std::filesystem::file_size(folder + file.at("path").get<std::string>(), error);
    if (error || bytes != file.at("bytes").get<std::uint64_t>()) return false;
  }
  return true;
}

void note_pack(const Plan& plan, const ordered_json& line, Gathered& gathered) {
  const auto index = line.at("pack").get<std::uint64_t>();
  if (!plan.job().pack || index >= plan.packs()) return;
  std::error_code error;
  const auto bytes = std::filesystem::file_size(plan.pack_path(index), error);
  if (error || bytes != line.at("bytes").get<std::uint64_t>()) return;
  const auto [begin, end] = plan.views_of_pack(index);
  for (std::uint64_t view = begin; view < end; ++view) gathered.packed[view] = true;
  for (const ordered_json& view : line.at("failed")) {
    const auto failed = view.get<std::uint64_t>();
    if (failed >= begin && failed < end) gathered.packed[failed] = false;
  }
}

Result<void> note(const Plan& plan, const ordered_json& line, Gathered& gathered) {
  const std::string kind = line.at("kind");
  if (kind == "pack") note_pack(plan, line, gathered);
  if (kind == "scene") {
    gathered.scenes[line.at("scene").get<std::uint64_t>()] = line;
  } else if (kind == "fail") {
    JobFailure failure;
    failure.scene = line.at("scene").get<std::uint64_t>();
    if (line.contains("view")) failure.view = line.at("view").get<std::int64_t>();
    failure.error = line.at("error");
    const std::int64_t key =
        failure.view >= 0 ? failure.view : -1 - static_cast<std::int64_t>(failure.scene);
    gathered.failures[key] = std::move(failure);
  } else if (kind == "end") {
    const double seconds = line.at("seconds").get<double>();
    gathered.seconds += seconds;
    gathered.longest = std::max(gathered.longest, seconds);
  }
  return {};
}

Result<Gathered> gather(const Plan& plan) {
  const bool packed = plan.job().pack.has_value();
  Gathered gathered{JournalIndex(packed ? 0 : plan.views()), {}, {}, {}, 0, 0.0, 0.0};
  if (packed) gathered.packed.resize(plan.views());
  const std::string folder = plan.folder();
  for (const std::string& path : journals_in(folder)) {
    auto added = gathered.index.add(
        path, [&](const ordered_json& line) { return files_are_there(folder, line); },
        [&](const ordered_json& line) { return note(plan, line, gathered); });
    if (!added) return added.error();
    ++gathered.journals;
  }
  return gathered;
}

// Each file that the job asks for, a view at a time.
class Files {
 public:
  Result<void> create(const Plan& plan, const SceneLines& scenes) {
    // The packs hold what is known of each view.
    const bool packed = plan.job().pack.has_value();
    if (!packed) {
      auto cameras = CamerasFile::create(plan.folder() + "cameras.json");
      if (!cameras) return cameras.error();
      cameras_.emplace(std::move(*cameras));
    }
    if (plan.job().objects) {
      auto objects = ObjectsFile::create(plan.folder() + "objects.json", scenes);
      if (!objects) return objects.error();
      objects_.emplace(std::move(*objects));
    }
    if (plan.job().coco_masks && !packed) {
      auto annotations = AnnotationsFile::create(
          plan.folder() + "annotations.json", scenes,
          plan.job().coco_counts ? MaskCounts::uncompressed : MaskCounts::compressed);
      if (!annotations) return annotations.error();
      annotations_.emplace(std::move(*annotations));
    }
    return {};
  }
  Result<void> add(const ordered_json& line) {
    if (auto ok = cameras_->add(line); !ok) return ok;
    if (objects_) {
      if (auto ok = objects_->add(line); !ok) return ok;
    }
    return annotations_ ? annotations_->add(line) : Result<void>();
  }
  std::vector<std::function<Result<void>()>> commits() {
    std::vector<std::function<Result<void>()>> all;
    if (cameras_) all.emplace_back([this] { return cameras_->finish(); });
    if (objects_) all.emplace_back([this] { return objects_->finish(); });
    if (annotations_) all.emplace_back([this] { return annotations_->finish(); });
    return all;
  }

 private:
  std::optional<CamerasFile> cameras_;
  std::optional<ObjectsFile> objects_;
  std::optional<AnnotationsFile> annotations_;
};

JobResults count(const Plan& plan, const Gathered& gathered) {
  JobResults results;
  results.views = plan.views();
  results.journals = gathered.journals;
  results.broken_lines = gathered.index.broken_lines();
  results.seconds = gathered.seconds;
  results.longest_run_s = gathered.longest;
  std::vector<bool> scene_whole(plan.job().scenes.size(), true);
  for (std::size_t scene = 0; scene < scene_whole.size(); ++scene) {
    for (std::uint64_t view = plan.first_view(scene); view < plan.first_view(scene + 1); ++view) {
      if (gathered.has(view)) {
        ++results.done;
        continue;
      }
      scene_whole[scene] = false;
      auto& missing = results.missing;
      if (!missing.empty() && missing.back().second + 1 == view) {
        missing.back().second = view;
      } else if (missing.size() < JobResults::kMostListed) {
        missing.emplace_back(view, view);
      }
    }
  }
  for (const auto& [key, failure] : gathered.failures) {
    if (results.failures.size() == JobResults::kMostListed) break;
    const bool known = failure.view >= 0 ? static_cast<std::uint64_t>(failure.view) < plan.views()
                                         : failure.scene < scene_whole.size();
    if (!known) continue;
    const bool made_since = failure.view >= 0
                                ? gathered.has(static_cast<std::uint64_t>(failure.view))
                                : scene_whole[failure.scene];
    if (!made_since) results.failures.push_back(failure);
  }
  return results;
}

ordered_json summary_of(const Plan& plan, const JobResults& results) {
  ordered_json json = {{"octrace", util::version()},
                       {"job", plan.job().file},
                       {"journals", results.journals},
                       {"views", results.views},
                       {"done", results.done},
                       {"left", results.views - results.done},
                       {"missing", ordered_json::array()},
                       {"failures", ordered_json::array()},
                       {"broken_lines", results.broken_lines},
                       {"seconds", results.seconds},
                       {"longest_run_s", results.longest_run_s}};
  for (const auto& [first, last] : results.missing) json["missing"].push_back({first, last});
  for (const JobFailure& failure : results.failures) {
    ordered_json entry;
    if (failure.view >= 0) {
      const View view = plan.view(static_cast<std::uint64_t>(failure.view));
      entry = {{"view", failure.view}, {"camera", plan.camera_name(view)}, {"frame", view.frame}};
    }
    entry["scene"] = plan.job().scenes[failure.scene].path;
    entry["scene_index"] = failure.scene;
    entry["error"] = failure.error;
    json["failures"].push_back(std::move(entry));
  }
  return json;
}

}  // namespace

Result<JobResults> write_job_results(const Plan& plan) {
  auto gathered = gather(plan);
  if (!gathered) return gathered.error();
  Files files;
  if (auto ok = files.create(plan, gathered->scenes); !ok) return ok.error();
  for (std::uint64_t view = 0; view < plan.views() && !plan.job().pack; ++view) {
    if (!gathered->index.has(view)) continue;
    auto line = gathered->index.line(view);
    if (!line) return line.error();
    if (auto ok = files.add(*line); !ok) return ok.error();
  }
  if (auto ok = util::commit_together(files.commits()); !ok) return ok.error();
  return count(plan, *gathered);
}

Result<JobResults> merge_job(const Plan& plan, const util::Limits& limits, double wait_lock) {
  if (journals_in(plan.folder()).empty()) {
    return util::Error{util::Exit::io, "IO_ERROR",
                       "no journal is there: nothing of this job was rendered",
                       state_folder(plan.folder()), ""};
  }
  // Shard 1 of 1 is at odds with every other division and with itself.
  auto lock = RunLock::acquire(plan.folder(), Shard(), {wait_lock, true});
  if (!lock) return lock.error();
  if (auto same = check_same_job(plan, plan.meaning(limits)); !same) return same.error();
  remove_result_leftovers(plan);  // of a merge that was killed
  auto results = write_job_results(plan);
  if (!results) return results.error();
  // Last: who finds it finds the others.
  const std::string text =
      summary_of(plan, *results).dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
  if (auto written = util::write_file(plan.folder() + "summary.json", text); !written) {
    return written.error();
  }
  return results;
}

}  // namespace octrace::batch
