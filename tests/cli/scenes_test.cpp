// Real scenes, through the whole program. The files are not the project's own: without them the
// tests skip.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "backend/image/image.h"
#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using nlohmann::json;

std::vector<std::string> scene_files(const std::string& kind) {
  std::vector<std::string> files;
  const std::filesystem::path root = std::filesystem::path(OCTRACE_SHARED_SCENES) / kind;
  std::error_code error;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root, error)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".gltf" && extension != ".glb") continue;
    files.push_back(std::filesystem::relative(entry.path(), root).string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string test_name(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}

class ValidScene : public ::testing::TestWithParam<std::string> {};

TEST_P(ValidScene, RendersAndIsDescribed) {
  Scratch scratch;
  const std::string file = std::string(OCTRACE_SHARED_SCENES) + "/valid/" + GetParam();
  const Outcome outcome =
      run({"render", file, "--size", "64x48", "--spp", "2", "--aov", "all", "--verify", "--quiet",
           "-o", scratch.path("a.exr"), "-o", scratch.path("b.png:beauty")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out + outcome.err, "");
  const util::Result<image::Image> image = image::read(scratch.path("a.exr"), {});
  ASSERT_TRUE(image) << image.error().to_string();
  double hits = 0.0;
  for (const float value : image->find("mask")->floats) hits += value;
  EXPECT_GT(hits, 0.0) << "an empty picture";
  for (const char* channel : {"R", "G", "B", "A"}) {
    for (const float value : image->find(channel)->floats) ASSERT_TRUE(std::isfinite(value));
  }
  const Outcome info = run({"info", file, "--json", "--quiet"});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_GT(json::parse(info.out)["flattened"]["triangles"], 0);
}

INSTANTIATE_TEST_SUITE_P(Files, ValidScene, ::testing::ValuesIn(scene_files("valid")), test_name);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ValidScene);

class MalformedScene : public ::testing::TestWithParam<std::string> {};

// One of the validator's codes, at its pointer or a parent of it: "FILE#POINTER: CODE: ...".
bool names_one_of(const std::string& said, const std::string& file, const json& expected) {
  const std::string start = "octrace: error: " + file;
  if (!said.starts_with(start)) return false;
  std::string rest = said.substr(start.size());
  std::string pointer;
  if (rest.starts_with("#")) {
    const std::size_t end = rest.find(": ");
    pointer = rest.substr(1, end - 1);
    rest = rest.substr(end);
  }
  for (const json& issue : expected) {
    const std::string code = issue["code"], at = issue["pointer"];
    const bool parent = at == pointer || at.starts_with(pointer + "/") || pointer.empty();
    if (parent && rest.starts_with(": " + code + ": ")) return true;
  }
  return false;
}

TEST_P(MalformedScene, IsRefusedByTheValidatorsCode) {
  const std::string root = std::string(OCTRACE_SHARED_SCENES) + "/malformed/";
  const json expected = json::parse(read_text(root + "expected.json"));
  ASSERT_TRUE(expected.contains(GetParam()));
  const std::string file = root + GetParam();
  for (const char* command : {"render", "info"}) {
    Scratch scratch;
    std::vector<std::string> arguments = {command, file};
    if (arguments[0] == "render") {
      arguments.insert(arguments.end(), {"-o", scratch.path("a.exr"), "--size", "16x16"});
    }
    const Outcome outcome = run(arguments);
    const bool missing = expected[GetParam()][0]["code"] == "IO_ERROR";
    EXPECT_EQ(outcome.exit_code, missing ? 5 : 3) << outcome.err;
    EXPECT_TRUE(names_one_of(outcome.err, file, expected[GetParam()]))
        << command << " says: " << outcome.err << "expected: " << expected[GetParam()].dump();
    EXPECT_TRUE(scratch.files().empty());
  }
}

INSTANTIATE_TEST_SUITE_P(Files, MalformedScene, ::testing::ValuesIn(scene_files("malformed")),
                         test_name);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MalformedScene);

}  // namespace
}  // namespace octrace::test
