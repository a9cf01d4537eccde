#include "backend/batch/runner.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <future>
#include <new>

#include "backend/batch/camera_choice.h"
#include "backend/batch/camera_sets.h"
#include "backend/batch/finish.h"
#include "backend/batch/hash.h"
#include "backend/batch/next_frame.h"
#include "backend/batch/scene_session.h"
#include "backend/batch/state.h"
#include "backend/batch/view_record.h"
#include "backend/batch/view_writer.h"
#include "backend/image/image.h"
#include "backend/render/tiles.h"
#include "backend/util/interrupt.h"
#include "backend/util/version.h"

namespace octrace::batch {

namespace {

using nlohmann::ordered_json;
using util::Result;
using Opened = Result<std::unique_ptr<SceneSession>>;

// The next scene is loaded when so many views of this one are left: early enough to be there, late
// enough not to hold two large scenes for long.
constexpr std::uint64_t kLoadAhead = 8;

struct Work {
  std::size_t scene = 0;
  std::uint64_t begin = 0, end = 0;  // views of this shard
  std::uint64_t left = 0;            // not done yet
};

std::string now_text() {
  return fmt::format(
      "{:%Y-%m-%dT%H:%M:%SZ}",
      fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

class Run {
 public:
  Run(const Plan& plan, const RunOptions& options, const Done& done, Journal& journal,
      RunSummary& summary)
      : plan_(plan),
        options_(options),
        done_(done),
        summary_(summary),
        threads_(render::effective_threads(options.threads)),
        writer_(plan, journal, threads_, summary.standing.left(), [this] { report(); }) {}

  void run();

 private:
  std::vector<Work> find_work() const;
  Opened open(std::size_t scene) const;
  void run_scene(const Work& work, Opened opened, const Work* next);
  Result<void> move_to(const View& view, SceneSession& session, render::Renderer& renderer);
  bool run_view(const View& view, SceneSession& session, render::Renderer& renderer);
  Result<scene::Camera> camera_of(const View& view, const SceneSession& session) const;
  bool stopping() const { return util::interrupt_flag() || writer_.stopped(); }
  void report();

  const Plan& plan_;
  const RunOptions& options_;
  const Done& done_;
  RunSummary& summary_;
  const unsigned threads_;
  util::Timer timer_;
  std::string scene_name_;
  scene::Bounds rest_bounds_;          // of the scene being traced
  std::optional<std::int64_t> frame_;  // where it stands; none: at rest
  std::optional<scene::Moment> next_;  // the frame after, where motion is asked for
  std::future<Opened> ahead_;
  std::mutex report_mutex_;
  ViewWriter writer_;
};

void Run::report() {
  if (!options_.progress) return;
  const ViewWriter::Outcome outcome = writer_.outcome();
  const std::lock_guard lock(report_mutex_);
  Standing standing = summary_.standing;
  standing.done = outcome.done;
  standing.failed = outcome.failed;
  standing.seconds = timer_.seconds();
  standing.scene = scene_name_;
  options_.progress(standing);
}

std::vector<Work> Run::find_work() const {
  std::vector<Work> all;
  const auto [begin, end] = plan_.part(options_.shard);
  for (std::size_t scene = 0; scene < plan_.job().scenes.size(); ++scene) {
    Work work{scene, std::max(begin, plan_.first_view(scene)),
              std::min(end, plan_.first_view(scene + 1)), 0};
    for (std::uint64_t view = work.begin; view < work.end; ++view) {
      if (!done_.has(view)) ++work.left;
    }
    if (work.left > 0) all.push_back(work);
  }
  return all;
}

Opened Run::open(std::size_t index) const {
  const Job& job = plan_.job();
  const JobScene& scene = job.scenes[index];
  SceneRequest request;
  request.source = scene.source;
  request.scene = scene.scene;
  request.variant = scene.variant;
  request.need_textures = needs_textures(plan_.needed_aovs());
  request.missing_images_warn = job.missing_images_warn;
  request.verify = options_.verify;
  request.build = options_.build;
  request.build.threads = options_.threads;
  request.limits = options_.limits;
  request.moving = request.refits = !job.frames.empty();
  if (job.animation) {
    const auto* name = std::get_if<std::string>(&*job.animation);
    request.animation =
        name != nullptr ? *name : std::to_string(std::get<std::int64_t>(*job.animation));
  }
  try {
    return open_scene(request);
  } catch (const std::bad_alloc&) {
    return util::Error{util::Exit::limit, "", "out of memory", scene.source, ""};
  }
}

void Run::run() {
  const std::vector<Work> work = find_work();
  for (std::size_t i = 0; i < work.size() && !stopping(); ++i) {
    {
      const std::lock_guard lock(report_mutex_);
      scene_name_ = plan_.job().scenes[work[i].scene].name;
    }
    const util::Timer load_timer;
    Opened opened = ahead_.valid() ? ahead_.get() : open(work[i].scene);
    summary_.load_ms += load_timer.milliseconds();
    if (!opened) {
      if (stopping()) break;
      for (std::uint64_t view = work[i].begin; view < work[i].end; ++view) {
        if (!done_.has(view)) writer_.skip(view);
      }
      writer_.fail({std::nullopt, work[i].scene, work[i].left, opened.error()});
      continue;
    }
    ++summary_.scenes_loaded;
    run_scene(work[i], std::move(opened), i + 1 < work.size() ? &work[i + 1] : nullptr);
  }
  if (ahead_.valid()) ahead_.wait();
  writer_.finish();
  const ViewWriter::Outcome outcome = writer_.outcome();
  summary_.standing.done = outcome.done;
  summary_.standing.failed = outcome.failed;
  summary_.standing.seconds = timer_.seconds();
  summary_.failures = outcome.failures;
  summary_.fatal = outcome.fatal;
  summary_.encode_ms = outcome.encode_ms;
  summary_.flush_ms = outcome.flush_ms;
  summary_.interrupted = util::interrupt_signal() != 0;
}

void Run::run_scene(const Work& work, Opened opened, const Work* next) {
  SceneSession& session = **opened;
  if (plan_.job().objects && !done_.scenes_described[work.scene]) {
    writer_.note_scene({{"kind", "scene"},
                        {"scene", work.scene},
                        {"source", plan_.job().scenes[work.scene].path},
                        {"name", plan_.job().scenes[work.scene].name},
                        {"objects", scene_objects_record(session.scene)}});
  }
  rest_bounds_ = session.scene.bounds;
  const auto renderer = render::make_renderer(session.scene, session.octree, options_.device);
  frame_.reset();
  next_.reset();
  std::uint64_t left = work.left;
  for (std::uint64_t index = work.begin; index < work.end && !stopping(); ++index) {
    if (done_.has(index)) continue;
    if (next != nullptr && left == std::min(kLoadAhead, work.left)) {
      ahead_ = std::async(std::launch::async, [this, scene = next->scene] { return open(scene); });
    }
    --left;
    const View view = plan_.view(index);
    if (auto there = move_to(view, session, *renderer); !there) {
      writer_.fail({view.index, view.scene, 1, there.error()});
      continue;
    }
    if (!run_view(view, session, *renderer)) return;
  }
}

// The scene at the view's time, where it is not there already.
Result<void> Run::move_to(const View& view, SceneSession& session, render::Renderer& renderer) {
  if (plan_.job().frames.empty() || frame_ == view.frame) return {};
  frame_.reset();
  auto moved = session.move_to(view.time);
  if (!moved) return moved.error();
  if (auto fresh = renderer.refresh(*moved); !fresh) return fresh;
  if (plan_.needed_aovs().test(static_cast<std::size_t>(kernels::Aov::motion))) {
    // Once for all cameras of the frame.
    auto next =
        session.at(scene::frame_time(static_cast<double>(view.frame) + 1.0, plan_.job().fps));
    if (!next) return next.error();
    next_ = std::move(*next);
  }
  frame_ = view.frame;
  return {};
}

// False: the run is to stop.
bool Run::run_view(const View& view, SceneSession& session, render::Renderer& renderer) {
  auto camera = camera_of(view, session);
  if (!camera) {
    writer_.fail({view.index, view.scene, 1, camera.error()});
    return true;
  }
  const util::Timer wait_timer;
  auto framebuffer = writer_.acquire();
  summary_.wait_ms += wait_timer.milliseconds();
  if (!framebuffer) return false;
  render::Settings settings;
  settings.params = plan_.job().params;
  settings.threads = options_.threads;
  settings.tile = options_.tile;
  settings.cancel = &util::interrupt_flag();
  const ImageSize& size = plan_.job().size;
  if (next_) settings.next = next_frame(session.scene, *camera, *next_, size);
  const util::Timer timer;
  auto traced = renderer.render(
      scene::make_ray_camera(*camera, static_cast<int>(size.width), static_cast<int>(size.height)),
      settings, *framebuffer);
  const double trace_ms = timer.milliseconds();
  summary_.trace_ms += trace_ms;
  if (!traced) {
    writer_.give_back(std::move(framebuffer));
    if (util::interrupt_flag()) return false;
    writer_.fail({view.index, view.scene, 1, traced.error()});
    return true;
  }
  summary_.device = traced->device;
  writer_.submit({view, std::move(*camera), std::move(framebuffer), trace_ms});
  return true;
}

Result<scene::Camera> Run::camera_of(const View& view, const SceneSession& session) const {
  const PlannedCamera planned = plan_.camera(view);
  const CameraEntry& entry = plan_.job().cameras[planned.entry];
  const ImageSize& size = plan_.job().size;
  const double aspect = static_cast<double>(size.width) / static_cast<double>(size.height);
  const auto& cameras = session.scene.cameras;
  const auto missing = [&](const std::string& which) {
    std::string there;
    for (const scene::Camera& camera : cameras) {
      there += (there.empty() ? "" : ", ") + camera.name;
    }
    return util::Error{util::Exit::usage, "",
                       fmt::format("there is no camera {}; the scene has {}", which,
                                   there.empty() ? "none" : there),
                       session.source, ""};
  };
  if (const auto* given = std::get_if<GivenCameras>(&entry)) {
    return given->cameras[planned.index];
  }
  if (const auto* orbit = std::get_if<OrbitCameras>(&entry)) {
    return orbit_camera(*orbit, planned.index, rest_bounds_, aspect);
  }
  if (const auto* named = std::get_if<NamedCamera>(&entry)) {
    if (const auto* name = std::get_if<std::string>(&named->which)) {
      for (const scene::Camera& camera : cameras) {
        if (camera.name == *name) return camera;
      }
      return missing(*name);
    }
    const auto index = static_cast<std::uint64_t>(std::get<std::int64_t>(named->which));
    if (index >= cameras.size()) return missing(std::to_string(index));
    return cameras[index];
  }
  if (cameras.empty() && planned.index == 0) return scene::frame_bounds(rest_bounds_, aspect);
  if (planned.index >= cameras.size()) return missing(std::to_string(planned.index));
  return cameras[planned.index];
}

ordered_json header_line(const Plan& plan, const ordered_json& meaning, const Shard& shard) {
  return {{"kind", "job"},
          {"journal", 1},
          {"octrace", util::version()},
          {"hash", fmt::format("{:016x}", hash_text(meaning.dump()))},
          {"shard", {shard.index, shard.count}},
          {"views", plan.views()},
          {"job", meaning}};
}

ordered_json run_line(const RunOptions& options, const Job& job) {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
  return {{"kind", "run"},     {"time", now_text()},   {"host", host.data()},
          {"pid", ::getpid()}, {"device", job.device}, {"threads", options.threads}};
}

Result<void> append(Journal& journal, const ordered_json& line) {
  return journal.append(line.dump(-1, ' ', false, ordered_json::error_handler_t::replace));
}

}  // namespace

Result<RunSummary> run_plan(const Plan& plan, const RunOptions& options) {
  if (auto made = make_folder(state_folder(plan.folder())); !made) return made.error();
  auto lock = RunLock::acquire(plan.folder(), options.shard, {options.wait_lock, false});
  if (!lock) return lock.error();
  const ordered_json meaning = plan.meaning(options.limits);
  if (options.force) {
    if (auto forgot = forget(plan, meaning, options.shard); !forgot) return forgot.error();
  }
  auto done = read_done(plan, meaning, options.shard);
  if (!done) return done.error();
  if (!done->clean) remove_leftovers(plan, options.shard);

  RunSummary summary;
  summary.broken_lines = done->broken_lines;
  const auto [begin, end] = plan.part(options.shard);
  summary.standing.views = end - begin;
  summary.standing.before = done->count;
  auto journal = Journal::open(journal_path(plan.folder(), options.shard));
  if (!journal) return journal.error();
  if (!done->has_journal) {
    auto appended = append(*journal, header_line(plan, meaning, options.shard));
    if (!appended) return appended.error();
  }
  if (auto appended = append(*journal, run_line(options, plan.job())); !appended) {
    return appended.error();
  }
  if (auto flushed = journal->flush(); !flushed) return flushed.error();
  if (summary.standing.left() > 0) {
    image::request_threads(1);  // writers run side by side: a thread each is enough
    Run(plan, options, *done, *journal, summary).run();
  }
  if (summary.interrupted) util::acknowledge_interrupt();
  // Before the journal's last line: a run that is killed here has not ended in good order, and the
  // next one looks for what it left.
  auto ended = [&]() -> Result<void> {
    try {
      return write_results(plan, options, summary);
    } catch (const std::bad_alloc&) {
      return util::Error{util::Exit::limit, "", "out of memory", plan.folder(), ""};
    }
  }();
  const ordered_json last = {{"kind", "end"},
                             {"seconds", summary.standing.seconds},
                             {"done", summary.standing.done},
                             {"failed", summary.standing.failed},
                             {"interrupted", summary.interrupted}};
  if (auto appended = append(*journal, last); ended) ended = appended;
  if (auto flushed = journal->flush(); ended) ended = flushed;
  if (!ended && !summary.fatal && !summary.interrupted) summary.fatal = ended.error();
  return summary;
}

}  // namespace octrace::batch
