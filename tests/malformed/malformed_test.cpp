// Every broken file ends in one error of the right kind, code and place.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "backend/gltf/document.h"
#include "tests/malformed/base_scene.h"
#include "tests/malformed/patch_cases.h"

namespace octrace::tests {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

// What a file may say: any of these codes, at the named place or at a parent of it.
struct FileCase {
  std::string folder, file;
  std::vector<std::pair<std::string, std::string>> issues;
};

void PrintTo(const FileCase& broken, std::ostream* stream) { *stream << broken.file; }

std::vector<FileCase> cases_of(const std::string& folder) {
  std::vector<FileCase> cases;
  std::ifstream stream(folder + "/expected.json");
  if (!stream) return cases;
  const json expected = json::parse(stream);
  for (const auto& [file, issues] : expected.items()) {
    FileCase found{folder, file, {}};
    for (const auto& issue : issues) found.issues.emplace_back(issue["code"], issue["pointer"]);
    cases.push_back(std::move(found));
  }
  return cases;
}

bool is_same_or_parent(const std::string& pointer, const std::string& of) {
  return of == pointer || (of.starts_with(pointer) && of[pointer.size()] == '/');
}

std::string test_name(std::string text) {
  for (char& c : text) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return text;
}

class MalformedFile : public testing::TestWithParam<FileCase> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MalformedFile);

TEST_P(MalformedFile, IsRefused) {
  const FileCase& file = GetParam();
  const std::string path = file.folder + "/" + file.file;
  const auto document = gltf::load(path, {});
  ASSERT_FALSE(document) << path << " was accepted";
  const util::Error& error = document.error();
  EXPECT_EQ(error.file, path);
  EXPECT_FALSE(error.message.empty());
  EXPECT_EQ(error.exit, error.code == "IO_ERROR" ? util::Exit::io : util::Exit::invalid_input);
  bool expected = false;
  for (const auto& [code, pointer] : file.issues) {
    expected = expected || (error.code == code && is_same_or_parent(error.pointer, pointer));
  }
  EXPECT_TRUE(expected) << error.to_string();
}

std::string name_of_file(const testing::TestParamInfo<FileCase>& info) {
  return test_name(info.param.file);
}
INSTANTIATE_TEST_SUITE_P(Shared, MalformedFile,
                         testing::ValuesIn(cases_of(OCTRACE_SHARED_SCENES "/malformed")),
                         name_of_file);
INSTANTIATE_TEST_SUITE_P(Own, MalformedFile,
                         testing::ValuesIn(cases_of(OCTRACE_TEST_DATA "/malformed")), name_of_file);

class Patched : public testing::TestWithParam<PatchCase> {};

TEST_P(Patched, IsRefused) {
  const PatchCase& broken = GetParam();
  const json scene = base_scene().patch(json::parse(broken.patch));
  const auto document = gltf::load_bytes(bytes_of(scene.dump()), "patched.gltf", {});
  ASSERT_FALSE(document) << "accepted";
  const util::Error& error = document.error();
  EXPECT_EQ(error.code, broken.code) << error.to_string();
  EXPECT_EQ(error.pointer, broken.pointer) << error.to_string();
  EXPECT_EQ(static_cast<int>(error.exit), broken.exit) << error.to_string();
}

std::string name_of_patch(const testing::TestParamInfo<PatchCase>& info) {
  return test_name(info.param.name);
}
INSTANTIATE_TEST_SUITE_P(Base, Patched, testing::ValuesIn(patch_cases()), name_of_patch);

std::vector<std::string> valid_files() {
  std::vector<std::string> files;
  std::error_code none;
  for (const auto& entry : fs::recursive_directory_iterator(OCTRACE_SHARED_SCENES, none)) {
    const std::string path = entry.path().string();
    const bool is_scene = path.ends_with(".gltf") || path.ends_with(".glb");
    if (is_scene && path.find("/malformed/") == std::string::npos) files.push_back(path);
  }
  std::sort(files.begin(), files.end());
  return files;
}

class ValidFile : public testing::TestWithParam<std::string> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ValidFile);

TEST_P(ValidFile, Loads) {
  const auto document = gltf::load(GetParam(), {});
  ASSERT_TRUE(document) << document.error().to_string();
  EXPECT_EQ(document->images.size(), document->model.images.size());
  for (std::size_t i = 0; i < document->model.buffers.size(); ++i) {
    EXPECT_FALSE(document->model.buffers[i].data.empty());
  }
}

std::string name_of_scene(const testing::TestParamInfo<std::string>& info) {
  return test_name(fs::path(info.param).stem().string());
}
INSTANTIATE_TEST_SUITE_P(Shared, ValidFile, testing::ValuesIn(valid_files()), name_of_scene);

// Without this the patched cases could all fail for a reason of their own.
TEST(BaseScene, LoadsAsTextAndAsGlb) {
  const auto text = gltf::load_bytes(bytes_of(base_scene().dump()), "base.gltf", {});
  ASSERT_TRUE(text) << text.error().to_string();
  EXPECT_TRUE(text->warnings.empty()) << text->warnings.front();
  json scene = base_scene();
  scene["buffers"][0].erase("uri");
  const auto glb = gltf::load_bytes(make_glb(scene.dump(), base_buffer()), "base.glb", {});
  ASSERT_TRUE(glb) << glb.error().to_string();
  EXPECT_TRUE(glb->model == text->model) << "the two forms differ";
}

}  // namespace
}  // namespace octrace::tests
