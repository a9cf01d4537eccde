#include "backend/app/reference_batch.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <thread>

#include "backend/scene/instances.h"
#include "backend/util/interrupt.h"
#include "exporters/gltf/gltf.h"
#include "exporters/povray/povray.h"

namespace octrace::app {

namespace {

using util::Error;
using util::Exit;
using util::Result;
using validation::Planes;

// Runs every task, `workers` at a time, the first ones first.
void run_tasks(const std::vector<std::function<void()>>& tasks, unsigned workers) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i; (i = next.fetch_add(1)) < tasks.size();) tasks[i]();
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 1; i < workers; ++i) threads.emplace_back(work);
  work();
}

}  // namespace

Result<ReferenceBatch> ReferenceBatch::create(const ReferenceOptions& options) {
  auto scratch = validation::Scratch::create("octrace-validate");
  if (!scratch) return scratch.error();
  return ReferenceBatch(options, std::move(*scratch));
}

Result<void> ReferenceBatch::add(const SceneRequest& request, const scene::Scene& shown,
                                 std::span<const scene::Camera> cameras) {
  // Neither program knows instances: both get every copy.
  std::optional<scene::Scene> copies;
  if (shown.instancing) {
    auto baked = scene::bake_instances(shown, request.limits);
    if (!baked) return baked.error();
    copies = std::move(*baked);
  }
  const scene::Scene& scene = copies ? *copies : shown;
  const std::size_t first = views_.size();
  const int width = static_cast<int>(options_.size.width);
  const int height = static_cast<int>(options_.size.height);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    ReferenceView view;
    std::optional<validation::PovrayJob> job;
    if (!options_.povray.empty()) {
      exporters::PovrayOptions povray;
      povray.width = width;
      povray.height = height;
      povray.cull = options_.cull;
      povray.alpha = options_.alpha;
      const std::string path = scratch_.file(fmt::format("view{}.pov", first + i));
      auto file = exporters::write_povray(scene, cameras[i], povray, path);
      if (!file) return file.error();
      view.povray_notes = file->notes;
      job = {scratch_.path(),     file->arguments,      file->image,
             options_.size.width, options_.size.height, file->depth_far};
    }
    views_.push_back(std::move(view));
    povray_jobs_.push_back(std::move(job));
  }
  if (options_.blender.empty()) return {};

  BlenderEntry entry{{.file = "",
                      .gltf_scene = request.scene,
                      .seconds = request.time,
                      .animation = request.animation,
                      .cull = options_.cull,
                      .alpha = options_.alpha,
                      .views = {}},
                     first};
  if (request.source.starts_with("builtin:") || copies) {
    entry.scene.file = scratch_.file(fmt::format("scene{}.glb", first));
    auto written = exporters::write_gltf(scene, entry.scene.file);
    if (!written) return written.error();
  } else {
    std::error_code failure;
    entry.scene.file = std::filesystem::absolute(request.source, failure).string();
    if (failure) return Error{Exit::io, "", failure.message(), request.source, ""};
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    exporters::BlenderView view{.camera = cameras[i],
                                .width = width,
                                .height = height,
                                .output = scratch_.file(fmt::format("view{}.exr", first + i))};
    exporters::blender_clip(scene.bounds, view);
    entry.scene.views.push_back(std::move(view));
  }
  blender_entries_.push_back(std::move(entry));
  return {};
}

validation::ProgramOptions ReferenceBatch::program(const std::string& path) const {
  const unsigned all =
      options_.threads ? options_.threads : std::max(1u, std::thread::hardware_concurrency());
  validation::ProgramOptions options;
  options.program = path;
  options.timeout = options_.timeout;
  options.threads = static_cast<int>(std::max(1u, all / std::max(1u, options_.jobs)));
  options.limits = options_.limits;
  options.cancel = &util::interrupt_flag();
  return options;
}

void ReferenceBatch::run_povray(std::size_t view) {
  views_[view].povray = validation::run_povray(*povray_jobs_[view], program(options_.povray));
}

void ReferenceBatch::run_blender(std::span<const BlenderEntry> entries, const std::string& name) {
  std::vector<exporters::BlenderScene> scenes;
  validation::BlenderJob job;
  std::vector<std::size_t> indices;
  for (const BlenderEntry& entry : entries) {
    scenes.push_back(entry.scene);
    for (std::size_t i = 0; i < entry.scene.views.size(); ++i) {
      job.views.push_back({entry.scene.views[i].output, options_.size.width, options_.size.height});
      indices.push_back(entry.first_view + i);
    }
  }
  const std::string script = scratch_.file(name + ".py");
  job.folder = scratch_.path();
  job.arguments = exporters::blender_arguments(script);
  const auto fail = [&](const Error& error) {
    for (const std::size_t index : indices) views_[index].blender.emplace(error);
  };
  if (auto written = exporters::write_blender(scenes, script); !written) {
    return fail(written.error());
  }
  validation::ProgramOptions options = program(options_.blender);
  options.timeout *= static_cast<int>(entries.size());
  auto planes = validation::run_blender(job, options);
  if (!planes) return fail(planes.error());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    views_[indices[i]].blender = std::move((*planes)[i]);
  }
  if (entries.size() == 1 || util::interrupt_signal() != 0) return;
  // A crash takes the scenes after it along: those get a process of their own, and so does the one
  // that caused it, whose log is then about nothing else.
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::size_t first = entries[i].first_view;
    const std::size_t end = first + entries[i].scene.views.size();
    const bool failed =
        std::any_of(views_.begin() + std::ptrdiff_t(first), views_.begin() + std::ptrdiff_t(end),
                    [](const ReferenceView& view) { return !*view.blender; });
    if (failed) run_blender(entries.subspan(i, 1), fmt::format("{}-{}", name, i));
  }
}

std::vector<ReferenceView> ReferenceBatch::run() {
  std::vector<std::function<void()>> tasks;
  if (!blender_entries_.empty()) {
    tasks.emplace_back([this] { run_blender(blender_entries_, "blender"); });
  }
  for (std::size_t view = 0; view < views_.size(); ++view) {
    if (povray_jobs_[view]) tasks.emplace_back([this, view] { run_povray(view); });
  }
  run_tasks(tasks, options_.jobs);
  povray_jobs_.clear();
  blender_entries_.clear();
  return std::move(views_);
}

}  // namespace octrace::app
