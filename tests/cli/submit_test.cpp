// Shards and their merging, and what is handed to Slurm, with an sbatch that only writes down what
// it was given. script/slurm-test runs a real one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr const char* kJob = R"({"version": 1, "scenes": ["builtin:default", "builtin:paper"],
  "cameras": [{"turntable": {"n": 4, "elevation": 20}}], "size": [32, 24],
  "aovs": ["Z", "object_id"], "masks": "coco", "output": "out/{scene}_{camera}.npz"})";

Outcome octrace(const Scratch& scratch, const std::vector<std::string>& arguments) {
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = arguments;
  return run(launch);
}

TEST(Merge, ShardsGiveTheFilesOfOneRun) {
  Scratch whole, parts;
  write_text(whole.path("job.json"), kJob);
  write_text(parts.path("job.json"), kJob);
  const Outcome one = octrace(whole, {"batch", "job.json"});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  for (const char* shard : {"3/3", "1/3"}) {
    ASSERT_EQ(octrace(parts, {"batch", "job.json", "--shard", shard}).exit_code, 0);
  }
  // A part is missing: what is there is merged, and the rest is named.
  const Outcome early = octrace(parts, {"batch", "job.json", "--merge"});
  EXPECT_EQ(early.exit_code, 8) << early.err;
  EXPECT_THAT(early.err, HasSubstr("views 2 to 4 are missing"));
  EXPECT_EQ(json::parse(read_text(parts.path("out/summary.json")))["missing"], json({{2, 4}}));
  EXPECT_EQ(json::parse(read_text(parts.path("out/cameras.json")))["views"].size(), 5u);

  ASSERT_EQ(octrace(parts, {"batch", "job.json", "--shard", "2/3"}).exit_code, 0);
  const Outcome merged = octrace(parts, {"batch", "job.json", "--merge"});
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  for (const char* name : {"cameras.json", "objects.json", "annotations.json"}) {
    EXPECT_EQ(read_text(parts.path(std::string("out/") + name)),
              read_text(whole.path(std::string("out/") + name)))
        << name;
  }
  const json annotations = json::parse(read_text(parts.path("out/annotations.json")));
  EXPECT_EQ(annotations["images"].size(), 8u);
  EXPECT_GE(annotations["annotations"].size(), 8u);

  // A file that is gone is missed.
  std::filesystem::remove(parts.path(
      "out/" + json::parse(read_text(parts.path("out/cameras.json")))["views"][6]["files"][0]
                   .get<std::string>()));
  const Outcome gone = octrace(parts, {"batch", "job.json", "--merge"});
  EXPECT_EQ(gone.exit_code, 8);
  EXPECT_THAT(gone.err, HasSubstr("view 6 is missing"));
}

TEST(Merge, NothingToMergeIsAnError) {
  Scratch scratch;
  write_text(scratch.path("job.json"), kJob);
  const Outcome outcome = octrace(scratch, {"batch", "job.json", "--merge"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("no journal"));
}

TEST(SubmitSlurm, DryRunPrintsScriptsAndWritesNothing) {
  Scratch scratch;
  write_text(scratch.path("job's.json"), kJob);
  const Outcome outcome =
      octrace(scratch, {"submit", "slurm", "job's.json", "--tasks", "3", "--dry-run",
                        "--sbatch-args", "--partition='a b' --time=1:00:00", "--max-views", "99"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("#SBATCH --array=1-3\n"));
  EXPECT_THAT(outcome.out, HasSubstr("#SBATCH --requeue\n"));
  EXPECT_THAT(outcome.out, HasSubstr(" --shard \"$SLURM_ARRAY_TASK_ID/3\""));
  EXPECT_THAT(outcome.out, HasSubstr("job'\\''s.json' '--max-views' '99' --shard"));
  EXPECT_THAT(outcome.out, HasSubstr("job'\\''s.json' '--max-views' '99' --merge"));
  EXPECT_THAT(outcome.out, HasSubstr("'--partition=a b' '--time=1:00:00'"));
  EXPECT_THAT(outcome.out, HasSubstr("'--dependency=afterany:ARRAY_JOB'"));
  EXPECT_THAT(scratch.files(), ::testing::ElementsAre("job's.json"));
}

TEST(SubmitSlurm, WithoutSbatchItSaysSo) {
  Scratch scratch;
  write_text(scratch.path("job.json"), kJob);
  Launch launch;
  launch.folder = scratch.folder();
  launch.program = "/bin/sh";
  launch.arguments = {"-c", std::string("PATH=/nowhere exec ") + OCTRACE_PROGRAM +
                                " submit slurm job.json --tasks 2"};
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("sbatch"));
  EXPECT_FALSE(std::filesystem::exists(scratch.path("out")));
}

// The script that was submitted renders a shard when it is run, and the other one merges.
TEST(SubmitSlurm, WhatIsSubmittedRuns) {
  Scratch scratch;
  std::filesystem::create_directory(scratch.path("bin"));
  std::filesystem::create_directory(scratch.path("a 'b'"));
  write_text(scratch.path("a 'b'/job.json"), kJob);
  write_text(scratch.path("bin/sbatch"), "#!/bin/sh\nprintf '%s\\n' \"$@\" >>'" +
                                             scratch.path("said") + "'\necho '41;cluster'\n");
  std::filesystem::permissions(scratch.path("bin/sbatch"), std::filesystem::perms::owner_all);
  Launch launch;
  launch.folder = scratch.folder();
  launch.program = "/bin/sh";
  launch.arguments = {"-c", "PATH=" + scratch.path("bin") + ":$PATH exec " + OCTRACE_PROGRAM +
                                " submit slurm \"a 'b'/job.json\" --tasks 99"};
  const Outcome outcome = run(launch);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("job 41, 8 tasks"));  // no more than there are views
  EXPECT_THAT(read_text(scratch.path("said")), HasSubstr("--dependency=afterany:41\n"));
  const std::string state = scratch.path("a 'b'/out/.octrace/");
  for (int task = 1; task <= 8; ++task) {
    launch.program = "/usr/bin/env";
    launch.arguments = {"SLURM_ARRAY_TASK_ID=" + std::to_string(task), "SLURM_CPUS_ON_NODE=1", "sh",
                        state + "slurm-array.sh"};
    const Outcome ran = run(launch);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
  }
  launch.arguments = {"sh", state + "slurm-merge.sh"};
  const Outcome merged = run(launch);
  EXPECT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_EQ(json::parse(read_text(scratch.path("a 'b'/out/summary.json")))["done"], 8);
}

}  // namespace
}  // namespace octrace::test
