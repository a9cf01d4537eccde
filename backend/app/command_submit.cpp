#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/batch/plan.h"
#include "backend/batch/slurm.h"
#include "backend/batch/state.h"
#include "backend/util/atomic_file.h"
#include "backend/util/log.h"
#include "validation/reference/process.h"

namespace octrace::app {

namespace {

using util::Result;

struct SubmitRequest {
  std::string job, out, sbatch_args;
  std::optional<std::string> merge_args, device;
  std::vector<std::string> given_limits;  // options with their values
  std::uint64_t tasks = 0;
  bool dry_run = false;
  util::Limits limits;
};

constexpr const char* kHelp =
    R"(Each task of the array runs a shard of the job; a task after it, however the others ended, merges their
journals into cameras.json, objects.json, annotations.json and summary.json. A task that Slurm requeues goes
on where it ended. Scripts and logs lie in .octrace/ beside the outputs, which all nodes must see.

Examples:
  octrace submit slurm job.json --tasks 16 --dry-run
  octrace submit slurm job.json --tasks 16 --sbatch-args "--partition=gpu --gres=gpu:1 --time=2:00:00" \
    --merge-args "--time=30")";

struct Submission {
  batch::SlurmJob job;
  std::string state;                                      // absolute, ends in '/'
  std::vector<std::string> array_command, merge_command;  // without the script; merge: without id
};

// In file names of logs sbatch takes % for its own fields.
std::string log_pattern(const std::string& state, const std::string& name) {
  std::string folder;
  for (const char c : state) folder += c == '%' ? std::string("%%") : std::string(1, c);
  return "--output=" + folder + name;
}

Result<Submission> plan_submission(const SubmitRequest& request) {
  auto job = batch::read_job(request.job, request.limits);
  if (!job) return job.error();
  std::string base = request.out.empty() ? job->folder : request.out;
  if (!base.empty() && !base.ends_with('/')) base += '/';
  auto plan = batch::Plan::make(std::move(*job), base, request.limits);
  if (!plan) return plan.error();
  auto array_args = batch::split_words(request.sbatch_args);
  if (!array_args) return array_args.error();
  auto merge_args = batch::split_words(request.merge_args.value_or(request.sbatch_args));
  if (!merge_args) return merge_args.error();

  Submission submission;
  std::error_code error;
  submission.job.program = std::filesystem::read_symlink("/proc/self/exe", error).string();
  submission.job.job = std::filesystem::absolute(request.job).lexically_normal().string();
  if (!request.out.empty()) {
    submission.job.out = std::filesystem::absolute(request.out).lexically_normal().string();
  }
  // More tasks than views, or packs, would have nothing to do.
  const std::uint64_t pieces = plan->job().pack ? plan->packs() : plan->views();
  submission.job.tasks = std::min(request.tasks, std::max<std::uint64_t>(pieces, 1));
  if (request.device) submission.job.options = {"--device", *request.device};
  submission.job.limits = request.given_limits;
  submission.state = batch::state_folder(
      std::filesystem::absolute(plan->folder() + ".").lexically_normal().string());
  submission.array_command = {"sbatch", "--parsable",
                              log_pattern(submission.state, "slurm-%A_%a.log")};
  submission.merge_command = {"sbatch", "--parsable",
                              log_pattern(submission.state, "slurm-%j-merge.log")};
  auto& array = submission.array_command;
  array.insert(array.end(), array_args->begin(), array_args->end());
  auto& merge = submission.merge_command;
  merge.insert(merge.end(), merge_args->begin(), merge_args->end());
  return submission;
}

std::string shell_line(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + batch::shell_word(word);
  return line;
}

// The id that sbatch --parsable prints: "17" or "17;cluster".
Result<std::string> submit(std::vector<std::string> arguments, const std::string& log) {
  validation::Command command;
  command.arguments = std::move(arguments);
  command.log = log;
  auto ran = validation::run_process(command);
  if (!ran) return ran.error();
  if (ran->exit_code != 0 || ran->timed_out) {
    return validation::process_error("sbatch", command, *ran);
  }
  std::ifstream in(log);
  std::string line, id;
  while (std::getline(in, line)) {
    const std::size_t digits = line.find_first_not_of("0123456789");
    if (digits != 0 && (digits == std::string::npos || line[digits] == ';')) {
      id = line.substr(0, digits);
    }
  }
  if (id.empty()) {
    return util::Error{util::Exit::io, "SBATCH",
                       "sbatch said no job's number: " + validation::log_tail(log), "", ""};
  }
  return id;
}

Result<util::Exit> run_submit(const SubmitRequest& request) {
  auto submission = plan_submission(request);
  if (!submission) return submission.error();
  const std::string array_script = batch::slurm_array_script(submission->job);
  const std::string merge_script = batch::slurm_merge_script(submission->job);
  const std::string array_path = submission->state + "slurm-array.sh";
  const std::string merge_path = submission->state + "slurm-merge.sh";
  auto array = submission->array_command;
  array.push_back(array_path);
  const auto merge = [&](const std::string& id) {
    auto words = submission->merge_command;
    words.push_back("--dependency=afterany:" + id);
    words.push_back(merge_path);
    return words;
  };
  if (request.dry_run) {
    fmt::print("# {}\n{}\n# {}\n{}\n{}\n{}\n", array_path, array_script, merge_path, merge_script,
               shell_line(array), shell_line(merge("ARRAY_JOB")));
    return util::Exit::ok;
  }
  auto program = validation::find_program("sbatch");
  if (!program) return program.error();
  if (auto made = batch::make_folder(submission->state); !made) return made.error();
  if (auto ok = util::write_file(array_path, array_script); !ok) return ok.error();
  if (auto ok = util::write_file(merge_path, merge_script); !ok) return ok.error();
  const std::string log = submission->state + "slurm-submit.log";
  auto id = submit(array, log);
  if (!id) return id.error();
  auto merge_id = submit(merge(*id), log);
  if (!merge_id) {
    util::log_error(fmt::format("job {} runs, but what merges it was not accepted", *id));
    return merge_id.error();
  }
  util::log_info(fmt::format("submitted: job {}, {} tasks; job {} merges them", *id,
                             submission->job.tasks, *merge_id));
  return util::Exit::ok;
}

}  // namespace

void declare_submit(CLI::App& program, Run& chosen) {
  auto request = std::make_shared<SubmitRequest>();
  CLI::App* command = program.add_subcommand("submit", "hand a batch to a cluster");
  command->require_subcommand(1);
  CLI::App* slurm = command->add_subcommand("slurm", "as an array of Slurm tasks");
  slurm->footer(kHelp);
  slurm->add_option("JOB", request->job, "the job, a .json file")->required()->type_name("");
  slurm->add_option("--tasks", request->tasks, "into how many shards the job is divided")
      ->required()
      ->check(CLI::Range(1, 1'000'000).description(""))
      ->type_name("N");
  slurm
      ->add_option("--sbatch-args", request->sbatch_args,
                   "more for sbatch, divided by blanks and quotes as in a shell")
      ->type_name("ARGS");
  slurm
      ->add_option("--merge-args", request->merge_args,
                   "the same for the task that merges [those of --sbatch-args]")
      ->type_name("ARGS");
  slurm
      ->add_option("--out", request->out, "folder of relative output paths [the job file's folder]")
      ->type_name("DIR");
  slurm->add_option("--device", request->device, "of every task, whatever the job says")
      ->type_name("DEVICE");
  slurm->add_flag("--dry-run", request->dry_run, "print the scripts and commands, submit nothing");
  add_limit_options(*slurm, request->limits);
  add_views_limit(*slurm, request->limits);
  add_verbosity_options(*slurm);
  slurm->callback([request, &chosen, slurm] {
    for (const CLI::Option* option : slurm->get_options()) {
      if (!option->get_name().starts_with("--max-") || option->count() == 0) continue;
      request->given_limits.push_back(option->get_name());
      request->given_limits.push_back(option->results().back());
    }
    chosen = [request] { return run_submit(*request); };
  });
}

}  // namespace octrace::app
