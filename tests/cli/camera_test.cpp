#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "backend/image/image.h"
#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

std::string metadata(const image::Image& image, const std::string& name) {
  for (const auto& [key, value] : image.metadata) {
    if (key == name) return value;
  }
  return "";
}

image::Image render(const Scratch& scratch, const std::string& file,
                    const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"render", "builtin:default",  "--size", "48x32",
                                        "--aov",  "Z,P,primitive_id", "-o",     scratch.path(file),
                                        "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  util::Result<image::Image> image = image::read(scratch.path(file), {});
  if (!image) throw std::runtime_error(image.error().to_string());
  return std::move(*image);
}

TEST(Camera, NameAndIndexAreTheSame) {
  Scratch scratch;
  const image::Image named = render(scratch, "a.exr", {"--camera", "main"});
  const image::Image numbered = render(scratch, "b.exr", {"--camera", "0"});
  const image::Image unnamed = render(scratch, "c.exr", {});
  EXPECT_EQ(read_text(scratch.path("a.exr")), read_text(scratch.path("b.exr")));
  EXPECT_EQ(read_text(scratch.path("a.exr")), read_text(scratch.path("c.exr")));
}

TEST(Camera, TheOneInTheMetadataIsACameraFile) {
  Scratch scratch;
  const image::Image first = render(scratch, "a.exr", {});
  write_text(scratch.path("camera.json"), metadata(first, "octrace:camera"));
  const image::Image again = render(scratch, "b.exr", {"--camera", scratch.path("camera.json")});
  for (const char* plane : {"Z", "P.X", "P.Y", "P.Z"}) {
    EXPECT_EQ(first.find(plane)->floats, again.find(plane)->floats) << plane;
  }
}

// A camera at a known place sees known depths: 3 m above the ground, looking straight down on it.
TEST(Camera, OrthographicAndPinholeFilesLookWhereTheySay) {
  Scratch scratch;
  const std::string down = "\"matrix\":[1,0,0,0, 0,0,-1,0, 0,1,0,0, 0,50,0,1]";
  write_text(scratch.path("o.json"),
             "{\"type\":\"orthographic\",\"xmag\":3,\"ymag\":2," + down + "}");
  write_text(scratch.path("p.json"),
             "{\"type\":\"pinhole\",\"fx\":600,\"fy\":600,\"cx\":24,\"cy\":16," + down + "}");
  for (const char* file : {"o.json", "p.json"}) {
    const image::Image image =
        render(scratch, "a.exr", {"--camera", scratch.path(file), "--cull", "none"});
    std::size_t hits = 0;
    for (std::size_t i = 0; i < 48 * 32; ++i) {
      if (image.find("primitive_id")->uints[i] == 0) continue;
      ++hits;
      EXPECT_NEAR(image.find("Z")->floats[i], 50.0f - image.find("P.Y")->floats[i], 1e-4f) << file;
    }
    EXPECT_GT(hits, 200u) << file;
  }
}

// A triangle seen from behind, by a turned camera.
TEST(Cull, BackFacesFollowTheMaterialOrTheOption) {
  Scratch scratch;
  const std::string both = read_text(OCTRACE_TEST_DATA "/triangle.gltf");
  std::string one = both;
  one.replace(one.find("\"doubleSided\": true"), 19, "\"doubleSided\": false");
  write_text(scratch.path("both.gltf"), both);
  write_text(scratch.path("one.gltf"), one);
  write_text(scratch.path("behind.json"),
             "{\"type\":\"perspective\",\"yfov\":0.7,"
             "\"matrix\":[-1,0,0,0, 0,1,0,0, 0,0,-1,0, 0.4,0.4,-2.5,1]}");
  const auto hits = [&](const std::string& file, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"render",
                                          scratch.path(file),
                                          "--size",
                                          "64x64",
                                          "-o",
                                          scratch.path("a.exr:mask"),
                                          "--quiet",
                                          "--camera",
                                          scratch.path("behind.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    const util::Result<image::Image> image = image::read(scratch.path("a.exr"), {});
    double sum = 0.0;
    for (const float value : image->find("mask")->floats) sum += value;
    return sum;
  };
  const double whole = hits("both.gltf", {});
  EXPECT_GT(whole, 300.0);
  EXPECT_EQ(hits("one.gltf", {}), 0.0);
  EXPECT_EQ(hits("one.gltf", {"--cull", "none"}), whole);
}

TEST(Camera, BrokenFilesAreRefused) {
  Scratch scratch;
  for (const char* text : {"", "{", "[]", "{\"type\":\"fisheye\"}", "{\"type\":\"perspective\"}"}) {
    write_text(scratch.path("c.json"), text);
    const Outcome outcome = run({"render", "builtin:paper", "-o", scratch.path("a.exr"), "--camera",
                                 scratch.path("c.json")});
    EXPECT_EQ(outcome.exit_code, 3) << text;
    EXPECT_THAT(outcome.err, ::testing::HasSubstr("c.json")) << text;
  }
  const Outcome missing = run({"render", "builtin:paper", "-o", scratch.path("a.exr"), "--camera",
                               scratch.path("none.json")});
  EXPECT_EQ(missing.exit_code, 5);
  EXPECT_FALSE(std::filesystem::exists(scratch.path("a.exr")));
}

}  // namespace
}  // namespace octrace::test
