#include "backend/batch/slurm.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace octrace::batch {

namespace {

// NFS 4 gives up the locks of a client after it was silent for 90 s, unless set otherwise.
constexpr int kWaitLockSeconds = 300;

// #SBATCH lines have rules of quoting of their own: only what needs none goes into them.
std::string job_name(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  std::string name = slash == std::string::npos ? path : path.substr(slash + 1);
  if (name.ends_with(".json")) name.resize(name.size() - 5);
  std::replace_if(
      name.begin(), name.end(),
      [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '_'; }, '_');
  return "octrace-" + name.substr(0, 60);
}

std::string command(const SlurmJob& job) {
  std::string line = "exec " + shell_word(job.program) + " batch " + shell_word(job.job);
  if (!job.out.empty()) line += " --out " + shell_word(job.out);
  for (const std::string& limit : job.limits) line += " " + shell_word(limit);
  return line;
}

}  // namespace

std::string shell_word(std::string_view text) {
  std::string word = "'";
  for (const char c : text) {
    if (c == '\'') {
      word += "'\\''";
    } else {
      word += c;
    }
  }
  return word + "'";
}

util::Result<std::vector<std::string>> split_words(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  bool in_word = false;
  char quote = '\0';
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quote != '\0') {
      if (c == quote) {
        quote = '\0';
      } else if (quote == '"' && c == '\\' && i + 1 < line.size()) {
        word += line[++i];
      } else {
        word += c;
      }
    } else if (c == '\'' || c == '"') {
      quote = c;
      in_word = true;
    } else if (c == ' ' || c == '\t' || c == '\n') {
      if (in_word) words.push_back(std::move(word));
      word.clear();
      in_word = false;
    } else {
      if (c == '\\' && i + 1 < line.size()) ++i;
      word += line[i];
      in_word = true;
    }
  }
  if (quote != '\0') {
    return util::Error{util::Exit::usage, "", fmt::format("a quote does not end: {}", line), "",
                       ""};
  }
  if (in_word) words.push_back(std::move(word));
  return words;
}

std::string slurm_array_script(const SlurmJob& job) {
  std::string more;
  for (const std::string& option : job.options) more += " " + shell_word(option);
  // A requeued task goes on where its journal ends, once the file server has given up the lock of
  // the node that died. Slurm says how many cores of the node are its own.
  return fmt::format(
      "#!/bin/sh\n"
      "#SBATCH --job-name={0}\n"
      "#SBATCH --array=1-{1}\n"
      "#SBATCH --requeue\n"
      "#SBATCH --open-mode=append\n"
      "{2} --shard \"$SLURM_ARRAY_TASK_ID/{1}\" --threads \"${{SLURM_CPUS_ON_NODE:-0}}\" "
      "--progress none --wait-lock {3}{4}\n",
      job_name(job.job), job.tasks, command(job), kWaitLockSeconds, more);
}

std::string slurm_merge_script(const SlurmJob& job) {
  return fmt::format(
      "#!/bin/sh\n"
      "#SBATCH --job-name={}-merge\n"
      "#SBATCH --requeue\n"
      "#SBATCH --open-mode=append\n"
      "{} --merge --wait-lock {}\n",
      job_name(job.job), command(job), kWaitLockSeconds);
}

}  // namespace octrace::batch
