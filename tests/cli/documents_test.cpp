// Every command of the documentation is run: lines of ```sh blocks that start with "octrace ", in
// order, in a folder of their own that keeps what earlier ones wrote. A ```json block that is a job
// is job.json for the commands after it.
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

struct Command {
  int line;
  std::string text;
  std::string job;  // of job.json; empty: none was shown
};

std::vector<Command> commands_of(const std::string& document) {
  std::vector<Command> commands;
  std::istringstream lines(document);
  bool shell = false, json = false;
  std::string block, job;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    if (line.starts_with("```")) {
      if (json && block.starts_with("{\"version\": 1,")) job = block;
      shell = !shell && line == "```sh";
      json = !json && line == "```json";
      block.clear();
      continue;
    }
    if (json) block += line + "\n";
    if (!shell) continue;
    while (line.ends_with("\\")) {
      line.pop_back();
      std::string more;
      std::getline(lines, more);
      ++number;
      line += more;
    }
    if (line.starts_with("octrace ")) commands.push_back({number, line, job});
  }
  return commands;
}

std::vector<std::string> documents() {
  std::vector<std::string> files = {"README.md"};
  std::error_code error;
  const std::filesystem::path docs = std::filesystem::path(OCTRACE_SOURCE) / "docs";
  for (const auto& entry : std::filesystem::directory_iterator(docs, error)) {
    if (entry.path().extension() == ".md")
      files.push_back("docs/" + entry.path().filename().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string test_name(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
  return name;
}

class Document : public ::testing::TestWithParam<std::string> {};

TEST_P(Document, EveryCommandRuns) {
  Scratch scratch;
  // The documents' own scene: a triangle, so that "scene.gltf" in an example is a file.
  for (const char* name : {"scene.gltf", "a.glb"}) {
    std::filesystem::copy_file(std::string(OCTRACE_SOURCE) + "/tests/data/triangle.gltf",
                               scratch.path(name));
  }
  const std::string folder = std::filesystem::path(OCTRACE_PROGRAM).parent_path().string();
  for (const Command& command :
       commands_of(read_text(std::string(OCTRACE_SOURCE) + "/" + GetParam()))) {
    if (!command.job.empty()) write_text(scratch.path("job.json"), command.job);
    Launch launch;
    launch.folder = scratch.folder();
    launch.program = "/bin/sh";
    launch.arguments = {"-c", "PATH=" + folder + ":$PATH; " + command.text};
    const Outcome outcome = run(launch);
    EXPECT_EQ(outcome.exit_code, 0)
        << GetParam() << ":" << command.line << ": " << command.text << "\n"
        << outcome.err;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, Document, ::testing::ValuesIn(documents()), test_name);

TEST(Readme, HasCommandsAndItsPicture) {
  const std::string readme = read_text(std::string(OCTRACE_SOURCE) + "/README.md");
  EXPECT_GE(commands_of(readme).size(), 5u);
  const std::string picture = std::string(OCTRACE_SOURCE) + "/docs/images/default.png";
  EXPECT_NE(readme.find("docs/images/default.png"), std::string::npos);
  EXPECT_LT(std::filesystem::file_size(picture), 400u * 1024u);
}

}  // namespace
}  // namespace octrace::test
