#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "backend/app/batch_progress.h"
#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/app/preload.h"
#include "backend/batch/plan.h"
#include "backend/batch/results.h"
#include "backend/batch/runner.h"
#include "backend/batch/state.h"
#include "backend/batch/summary.h"
#include "backend/scene/builtin.h"
#include "backend/util/interrupt.h"
#include "backend/util/log.h"

namespace octrace::app {

namespace {

using util::Result;

struct BatchRequest {
  std::string job, out, shard;
  std::optional<std::string> device;
  std::optional<std::uint32_t> spp;
  bool dry_run = false, merge = false;
  BatchProgressMode progress = BatchProgressMode::automatic;
  batch::RunOptions run;
};

constexpr const char* kHelp = R"(The least job:
  {"version": 1, "scenes": ["a.glb"], "cameras": [{"turntable": {"n": 30, "elevation": 20}}],
   "size": [640, 480], "aovs": ["Z", "mask", "object_id"],
   "output": "out/{scene}_{camera}_{frame:04}.exr"}

Paths are relative to the job file. What is done is noted in .octrace/ beside the outputs, so after an
interrupt, a crash or a full disk the same command goes on.

Exit code 0: all done; 2: the job is wrong, or not the one that was begun; 5: a full disk, a folder that
cannot be written or is in use; 8: some scenes or views failed, the rest is done.

Examples:
  octrace batch job.json --dry-run
  octrace batch job.json --progress json
  octrace batch job.json --shard 3/16)";

Result<batch::Shard> parse_shard(const std::string& text) {
  batch::Shard shard;
  if (text.empty()) return shard;
  const std::size_t slash = text.find('/');
  const auto number = [&](std::string_view part, std::uint64_t& into) {
    const char* end = part.data() + part.size();
    const auto [stop, error] = std::from_chars(part.data(), end, into);
    return !part.empty() && error == std::errc() && stop == end;
  };
  const std::string_view view(text);
  if (slash == std::string::npos || !number(view.substr(0, slash), shard.index) ||
      !number(view.substr(slash + 1), shard.count) || shard.index < 1 ||
      shard.index > shard.count || shard.count > 1'000'000'000) {
    return usage_error(
        fmt::format("--shard: '{}' is not I/N, such as 3/16, with I from 1 to N", text));
  }
  return shard;
}

Result<batch::Plan> make_plan(BatchRequest& request) {
  auto job = batch::read_job(request.job, request.run.limits);
  if (!job) return job.error();
  if (request.device) job->device = *request.device;
  if (request.spp) {
    if (*request.spp == 0) return usage_error("--spp: at least 1 is needed");
    job->params.spp = *request.spp;
  }
  auto device = render::parse_device(job->device);
  if (!device) return device.error();
  request.run.device = *device;
  std::string base = request.out.empty() ? job->folder : request.out;
  if (!base.empty() && !base.ends_with('/')) base += '/';
  return batch::Plan::make(std::move(*job), base, request.run.limits);
}

// Many file systems, and all listings, are slow with more files in a folder.
constexpr std::uint64_t kCrowd = 100'000;

void warn_of_crowds(const batch::Plan& plan) {
  const batch::Plan::Crowd crowd = plan.largest_crowd();
  if (crowd.files <= kCrowd) return;
  util::log_warning(
      fmt::format("{} files in the one folder {}: a part such as {{view/1000:06}}/ in the output's "
                  "path spreads them",
                  crowd.files, crowd.folder.empty() ? "." : crowd.folder));
}

Result<util::Exit> dry_run(const batch::Plan& plan, const BatchRequest& request) {
  auto done = batch::read_done(plan, plan.meaning(request.run.limits), request.run.shard);
  if (!done && !(request.run.force && done.error().exit == util::Exit::usage)) return done.error();
  const auto [begin, end] = plan.part(request.run.shard);
  std::uint64_t there = 0;
  for (std::uint64_t index = begin; index < end; ++index) {
    if (!request.run.force && done->has(index)) {
      ++there;
      continue;
    }
    if (plan.job().pack) {
      if (index == plan.views_of_pack(plan.pack_of(index)).first) {
        fmt::print("{}\n", plan.pack_path(plan.pack_of(index)));
      }
      continue;
    }
    for (const batch::Output& file : plan.files(plan.view(index))) fmt::print("{}\n", file.path);
  }
  for (std::size_t i = 0; i < plan.job().scenes.size(); ++i) {
    if (plan.first_view(i) >= end || plan.first_view(i + 1) <= begin) continue;
    const batch::JobScene& scene = plan.job().scenes[i];
    std::error_code error;
    if (!scene.source.starts_with(scene::kBuiltinPrefix) &&
        !std::filesystem::exists(scene.source, error)) {
      util::log_warning(
          fmt::format("{}: there is no such file; its views will fail", scene.source));
    }
  }
  util::log_info(fmt::format("{} views of {} scenes in this run, {} of them done; nothing was made",
                             end - begin, plan.job().scenes.size(), there));
  return util::Exit::ok;
}

void tell(const batch::Plan& plan, const batch::RunSummary& summary) {
  for (const batch::Failure& failure : summary.failures) {
    util::log_error(batch::failure_text(plan, failure));
  }
  const batch::Standing& standing = summary.standing;
  if (summary.broken_lines > 0) {
    util::log_warning(fmt::format("{} broken lines in journals; their views were made again",
                                  summary.broken_lines));
  }
  util::log_info(
      fmt::format("{} of {} views done ({} before), {} failed, in {:.1f} s: {:.1f} views/s{}{}",
                  standing.before + standing.done, standing.views, standing.before, standing.failed,
                  standing.seconds, standing.views_per_s(), summary.device.empty() ? "" : " on ",
                  summary.device));
  if (standing.left() > 0) util::log_info("the same command goes on");
}

Result<util::Exit> merge(const batch::Plan& plan, const BatchRequest& request) {
  const util::InterruptGuard interruptible;
  auto results = batch::merge_job(plan, request.run.limits, request.run.wait_lock);
  if (!results) return results.error();
  for (const auto& [first, last] : results->missing) {
    util::log_error(first == last ? fmt::format("view {} is missing", first)
                                  : fmt::format("views {} to {} are missing", first, last));
  }
  util::log_info(fmt::format("{} of {} views done, by {} journals; {}summary.json", results->done,
                             results->views, results->journals, plan.folder()));
  return results->done == results->views ? util::Exit::ok : util::Exit::partial;
}

Result<util::Exit> run_batch(BatchRequest request) {
  auto shard = parse_shard(request.shard);
  if (!shard) return shard.error();
  request.run.shard = *shard;
  auto plan = make_plan(request);
  if (!plan) return plan.error();
  if (request.merge) return merge(*plan, request);
  warn_of_crowds(*plan);
  if (request.dry_run) return dry_run(*plan, request);
  preload_libraries(batch::needs_image_library(plan->files(plan->view(0))));
  BatchProgress progress(request.progress);
  request.run.progress = [&](const batch::Standing& standing) { progress.update(standing); };
  const util::InterruptGuard interruptible;
  auto summary = batch::run_plan(*plan, request.run);
  if (!summary) return summary.error();
  progress.finish(summary->standing);
  tell(*plan, *summary);
  if (summary->fatal) return *summary->fatal;
  if (summary->interrupted) return util::Error{util::Exit::io, "", "interrupted", "", ""};
  return summary->standing.failed > 0 ? util::Exit::partial : util::Exit::ok;
}

void declare_running(CLI::App& command, BatchRequest& request) {
  command.add_option("JOB", request.job, "the job, a .json file")->required()->type_name("");
  command
      .add_option("--out", request.out, "folder of relative output paths [the job file's folder]")
      ->type_name("DIR");
  command.add_flag("--dry-run", request.dry_run,
                   "list the files that would be made, and make none");
  command.add_flag(
      "--merge", request.merge,
      "render nothing: write cameras.json and the like from the journals of all shards");
  command.add_flag("--force", request.run.force, "forget what was done, and start anew");
  command
      .add_option("--wait-lock", request.run.wait_lock,
                  "wait so long where another process holds this shard's lock, or with --merge any "
                  "lock of the folder; a Slurm task waits only for its own earlier run [0]")
      ->check(CLI::Range(0.0, 1e6).description(""))
      ->type_name("SECONDS");
  command.add_option("--shard", request.shard, "only part I of N, from 1 [all]")->type_name("I/N");
  command
      .add_option("--device", request.device, "auto, cpu, cuda or cuda:N, whatever the job says")
      ->type_name("DEVICE");
  command.add_option("--spp", request.spp, "samples a pixel of beauty, whatever the job says")
      ->type_name("N");
  command
      .add_option("--threads", request.run.threads,
                  "threads that trace; two more encode and write; 0: all cores [0]")
      ->check(CLI::Range(0, 4096).description(""))
      ->type_name("N");
  add_choice<BatchProgressMode>(
      command, "--progress", request.progress,
      {{"auto", BatchProgressMode::automatic},
       {"bar", BatchProgressMode::bar},
       {"json", BatchProgressMode::json},
       {"openjd", BatchProgressMode::openjd},
       {"none", BatchProgressMode::none}},
      "auto: a bar on a terminal, nothing when piped; json: lines on standard error; openjd: lines "
      "of Open Job Description on standard output [auto]");
}

}  // namespace

void declare_batch(CLI::App& program, Run& chosen) {
  auto request = std::make_shared<BatchRequest>();
  CLI::App* command =
      program.add_subcommand("batch", "render many views of many scenes, and go on where it ended");
  command->footer(kHelp);
  declare_running(*command, *request);
  add_tuning_options(*command, request->run.build, request->run.verify);
  add_limit_options(*command, request->run.limits);
  add_views_limit(*command, request->run.limits);
  add_verbosity_options(*command);
  command->callback([request, &chosen] { chosen = [request] { return run_batch(*request); }; });
}

}  // namespace octrace::app
