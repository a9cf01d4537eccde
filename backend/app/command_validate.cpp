#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/app/reference_batch.h"
#include "backend/app/reference_limits.h"
#include "backend/app/time_options.h"
#include "backend/app/validation_times.h"
#include "backend/app/validation_views.h"
#include "backend/image/image.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"
#include "backend/util/version.h"
#include "validation/reference/version.h"
#include "validation/report/report.h"

namespace octrace::app {

namespace {

using util::Error;
using util::Exit;
using util::Result;
using validation::Comparison;
using validation::Status;

// Views whose images are held in memory at once, and that share one start of Blender.
constexpr std::size_t kBatchViews = 48;

struct ValidateRequest {
  std::vector<std::string> sources;
  std::vector<std::string> against{"povray", "blender"};
  std::string size = "640x480", report, povray = "povray", blender = "blender";
  std::string device = "auto";
  std::vector<std::string> tolerances;
  int timeout = 120;
  SceneRequest scene;
  TimeOptions time;
  std::optional<int> keys;
  ViewOptions views;
  ReferenceOptions references;
};

constexpr const char* kHelp =
    R"(Renders every scene and camera with octrace and with each program, compares masks, depths and object
ids, and prints one line a comparison. POV-Ray gets the triangles that octrace traces, so it checks the
tracer and the camera; Blender reads the original file with its own importer, so it checks the loader
as well, and with --time, --frame or --keys its own evaluation of the animation, which is glTF's at keys only.
Every camera of the scene is used; a scene that has none is framed from three sides. Back faces and
alpha MASK are treated alike on both sides; BLEND is opaque to depth.

Exit code 0: all agree; 1: some differ; 4: a program is missing; 5: a program failed.

Examples:
  octrace validate scene.glb
  octrace validate scenes/*.glb --against povray --report out/report --jobs 2)";

struct Batch {
  ReferenceBatch references;
  struct Entry {
    std::string scene;
    ValidationView view;
    ReferenceLimits blender_limits;
  };
  std::vector<Entry> entries;
};

struct State {
  const ValidateRequest& request;
  validation::Report report;
  validation::Tolerances povray = validation::kPovrayTolerances;
  validation::Tolerances blender = validation::kBlenderTolerances;
  std::optional<Error> failure;  // the first
};

// File names are enough to tell scenes apart unless two are the same.
std::string label(const std::string& source, const std::vector<std::string>& sources) {
  const auto name = [](const std::string& path) {
    return std::filesystem::path(path).filename().string();
  };
  const auto same = [&](const std::string& other) { return name(other) == name(source); };
  return std::count_if(sources.begin(), sources.end(), same) > 1 ? source : name(source);
}

void record(State& run, Comparison comparison) {
  fmt::print("{}\n", validation::one_line(comparison));
  std::fflush(stdout);
  run.report.comparisons.push_back(std::move(comparison));
}

void record_failure(State& run, Comparison comparison, const Error& error) {
  comparison.status = Status::error;
  comparison.cause = error.to_string();
  if (!run.failure) run.failure = error;
  record(run, std::move(comparison));
}

// Blender's pass index has 15 bits; beyond them the exporter keeps the low ones.
void keep_low_bits(validation::Planes& planes) {
  for (std::uint32_t& id : planes.object_id) id &= exporters::kBlenderMaxObject;
}

void compare_view(State& run, const Batch::Entry& entry, const ReferenceView& reference) {
  const auto compare = [&](const char* name, const Result<validation::Planes>& planes,
                           const validation::Tolerances& tolerances, const ReferenceLimits& limits,
                           bool low_bits) {
    Comparison comparison;
    comparison.scene = entry.scene;
    comparison.camera = entry.view.camera.name;
    comparison.first = "octrace";
    comparison.second = name;
    comparison.notes = limits.shown_otherwise;
    if (!planes) {
      // A program that refuses what it does not know has said so; one that is broken has not.
      if (limits.refused.empty()) {
        return record_failure(run, std::move(comparison), planes.error());
      }
      comparison.status = Status::exception;
      comparison.cause = fmt::format("{}", fmt::join(limits.refused, "; "));
      return record(run, std::move(comparison));
    }
    validation::CompareOptions options;
    options.tolerances = tolerances;
    options.beauty = false;
    options.pictures = !run.request.report.empty();
    validation::Planes ours = entry.view.planes;
    if (low_bits) keep_low_bits(ours);
    auto filled = validation::fill_comparison(comparison, ours, *planes, options);
    if (!filled) return record_failure(run, std::move(comparison), filled.error());
    if (comparison.status == Status::differ && !limits.shown_otherwise.empty()) {
      comparison.status = Status::exception;
      comparison.cause = fmt::format("{}", fmt::join(limits.shown_otherwise, "; "));
    }
    if (comparison.geometry->covered_a == 0 && comparison.geometry->covered_b == 0) {
      comparison.notes.emplace_back("Nothing of the scene is in view of this camera.");
    }
    record(run, std::move(comparison));
  };
  if (reference.povray) {
    compare("POV-Ray", *reference.povray, run.povray, {reference.povray_notes, {}}, false);
  }
  if (reference.blender) {
    compare("Blender", *reference.blender, run.blender, entry.blender_limits, true);
  }
}

Result<void> add_scene(State& run, const SceneRequest& scene_request, const std::string& name,
                       Batch& batch) {
  const ValidateRequest& request = run.request;
  auto session = open_scene(scene_request);
  if (!session) return session.error();
  auto views = render_views((*session)->scene, (*session)->octree, request.views);
  if (!views) return views.error();
  auto limits = blender_limits(scene_request, (*session)->scene);
  if (!limits) return limits.error();
  std::vector<scene::Camera> cameras;
  for (const ValidationView& view : *views) cameras.push_back(view.camera);
  auto added = batch.references.add(scene_request, (*session)->scene, cameras);
  if (!added) return added.error();
  for (ValidationView& view : *views) {
    batch.entries.push_back({name, std::move(view), *limits});
  }
  return {};
}

Result<void> finish_batch(State& run, Batch& batch) {
  const std::vector<ReferenceView> references = batch.references.run();
  if (util::interrupt_signal() != 0) return Error{Exit::io, "", "interrupted", "", ""};
  for (std::size_t i = 0; i < batch.entries.size(); ++i) {
    compare_view(run, batch.entries[i], references[i]);
  }
  return {};
}

Result<std::unique_ptr<Batch>> new_batch(const ValidateRequest& request) {
  auto references = ReferenceBatch::create(request.references);
  if (!references) return references.error();
  return std::make_unique<Batch>(Batch{std::move(*references), {}});
}

// Every moment of one scene.
Result<void> add_moments(State& run, const std::string& source, std::unique_ptr<Batch>& batch) {
  SceneRequest request = run.request.scene;
  request.source = source;
  request.need_textures = false;
  auto times = validation_times(request, run.request.time, run.request.keys);
  if (!times) return times.error();
  for (const ValidationTime& time : *times) {
    if (util::interrupt_signal() != 0) return Error{Exit::io, "", "interrupted", "", ""};
    if (!batch) {
      auto next = new_batch(run.request);
      if (!next) return next.error();
      batch = std::move(*next);
    }
    request.time = time.seconds;
    request.animation = time.animation;
    const std::string name = label(source, run.request.sources) + time.label;
    if (auto added = add_scene(run, request, name, *batch); !added) return added;
    if (batch->entries.size() < kBatchViews) continue;
    if (auto finished = finish_batch(run, *batch); !finished) return finished;
    batch.reset();
  }
  return {};
}

Result<void> run_scenes(State& run) {
  std::unique_ptr<Batch> batch;
  for (const std::string& source : run.request.sources) {
    if (auto added = add_moments(run, source, batch); !added) {
      if (util::interrupt_signal() != 0) return added.error();
      Comparison comparison;
      comparison.scene = label(source, run.request.sources);
      comparison.first = comparison.second = "octrace";
      record_failure(run, std::move(comparison), added.error());
    }
  }
  return batch ? finish_batch(run, *batch) : Result<void>();
}

Result<void> prepare(ValidateRequest& request, State& run) {
  auto size = parse_size(request.size, request.scene.limits);
  if (!size) return size.error();
  util::Result<render::DeviceChoice> device = render::parse_device(request.device);
  if (!device) return device.error();
  request.views.device = *device;
  request.views.size = request.references.size = *size;
  request.references.cull = request.views.cull;
  request.references.alpha = request.views.alpha;
  request.references.limits = request.scene.limits;
  request.references.timeout = std::chrono::seconds(request.timeout);
  request.views.threads = request.references.threads = request.scene.build.threads;
  for (const std::string& assignment : request.tolerances) {
    for (validation::Tolerances* tolerances : {&run.povray, &run.blender}) {
      if (auto set = validation::override_tolerance(*tolerances, assignment); !set) return set;
    }
  }
  // Before any work: a run of minutes should not end with a program that was never there.
  const auto wanted = [&](const char* name) {
    return std::find(request.against.begin(), request.against.end(), name) != request.against.end();
  };
  const struct {
    const char *name, *title;
    const std::string& program;
    std::string& path;
    const validation::Tolerances& tolerances;
  } programs[] = {{"povray", "POV-Ray", request.povray, request.references.povray, run.povray},
                  {"blender", "Blender", request.blender, request.references.blender, run.blender}};
  for (const auto& entry : programs) {
    if (!wanted(entry.name)) continue;
    auto version = validation::program_version(entry.program);
    if (!version) {
      version.error().message +=
          fmt::format(" (needed by --against {0}; --{0} PATH names another)", entry.name);
      return version.error();
    }
    entry.path = version->path;
    run.report.facts.emplace_back(entry.title, version->text);
    run.report.tolerances.emplace_back(entry.title, entry.tolerances);
  }
  return {};
}

void print_summary(const validation::Totals& sum, std::size_t scenes, double seconds) {
  fmt::print(
      "{} scenes, {} comparisons: {} agree, {} differ, {} exceptions, {} not compared; {:.1f} s\n",
      scenes, sum.comparisons, sum.agree, sum.differ, sum.exceptions, sum.errors, seconds);
}

Result<Exit> run_validate(ValidateRequest request) {
  const auto start = std::chrono::steady_clock::now();
  State run{.request = request, .report = {}, .failure = {}};
  const util::InterruptGuard interruptible;
  if (auto prepared = prepare(request, run); !prepared) return prepared.error();
  image::preload();
  if (auto ran = run_scenes(run); !ran) return ran.error();

  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const validation::Totals sum = validation::totals(run.report);
  print_summary(sum, request.sources.size(), seconds);
  if (!request.report.empty()) {
    auto& facts = run.report.facts;
    run.report.title = "octrace validate";
    facts.insert(facts.begin(), {"octrace", util::version()});
    facts.emplace_back("image size",
                       fmt::format("{} x {}", request.views.size.width, request.views.size.height));
    facts.emplace_back(
        "back faces, alpha",
        fmt::format("{}, {}", request.views.cull ? "culled as doubleSided says" : "shown",
                    request.views.alpha ? "MASK cuts out, BLEND is opaque" : "opaque"));
    facts.emplace_back("date", fmt::format("{:%Y-%m-%d %H:%M} UTC",
                                           fmt::gmtime(std::chrono::system_clock::to_time_t(
                                               std::chrono::system_clock::now()))));
    facts.emplace_back("time", fmt::format("{:.1f} s", seconds));
    if (auto written = validation::write_report(run.report, request.report); !written) {
      return written.error();
    }
    util::log_info(fmt::format("report: {}/index.html", request.report));
  }
  if (run.failure) return *run.failure;
  return sum.differ > 0 ? Exit::different : Exit::ok;
}

void declare_options(CLI::App& command, ValidateRequest& request) {
  command.add_option("SCENE", request.sources, "glTF files, or builtin:NAME")->required();
  command.add_option("--against", request.against, "programs to compare with [povray,blender]")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember({"povray", "blender"}))
      ->type_name("LIST");
  command
      .add_option("--camera", request.views.camera,
                  "ALL: every camera of each scene, three framings where it has none [ALL]")
      ->type_name("ALL|NAME|INDEX|FILE.json");
  command.add_option("--size", request.size, "pixels [640x480]")->type_name("WxH");
  command
      .add_option("--report", request.report,
                  "write index.html and report.json to this folder, with pictures")
      ->type_name("DIR");
  command.add_option("--jobs", request.references.jobs, "programs that run at once [1]")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  command.add_option("--povray", request.povray, "POV-Ray 3.7 [povray]")->type_name("PROGRAM");
  command.add_option("--blender", request.blender, "Blender 3.4 or later [blender]")
      ->type_name("PROGRAM");
  command.add_option("--timeout", request.timeout, "seconds that a program may take a scene [120]")
      ->check(CLI::Range(1, 86400))
      ->type_name("S");
  command
      .add_option(
          "--tolerance", request.tolerances,
          "change a limit for this run; may be repeated (octrace compare --help lists them)")
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
  command
      .add_option("--device", request.device,
                  "where octrace traces: auto, cpu, cuda or cuda:N [auto]")
      ->type_name("DEVICE");
  command
      .add_option("--cull", request.views.cull,
                  "back faces: spec culls them as doubleSided says [spec]")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, bool>{{"none", false}, {"spec", true}}))
      ->type_name("spec|none");
  command
      .add_option("--alpha", request.views.alpha,
                  "spec: alpha mode MASK cuts out; ignore: everything is opaque [spec]")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, bool>{{"ignore", false}, {"spec", true}}))
      ->type_name("spec|ignore");
  command
      .add_option("--scene", request.scene.scene, "index of the glTF scene [the file's default]")
      ->check(CLI::NonNegativeNumber);
  add_time_options(command, request.time);
  command
      .add_option("--keys", request.keys,
                  "instead of one time, N key times of each animation (or of --animation); 0: all")
      ->check(CLI::Range(0, 1 << 30).description(""))
      ->excludes("--time")
      ->excludes("--frame")
      ->type_name("N");
  command
      .add_option("--threads", request.scene.build.threads,
                  "threads for octrace and for all programs together; 0: all cores [0]")
      ->check(CLI::Range(0, 4096))
      ->type_name("N");
  add_limit_options(command, request.scene.limits);
  add_verbosity_options(command);
}

}  // namespace

void declare_validate(CLI::App& program, Run& chosen) {
  auto request = std::make_shared<ValidateRequest>();
  CLI::App* command =
      program.add_subcommand("validate", "check octrace's images against POV-Ray's and Blender's");
  command->footer(kHelp);
  declare_options(*command, *request);
  command->callback([request, &chosen] { chosen = [request] { return run_validate(*request); }; });
}

}  // namespace octrace::app
