#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>

#include "backend/image/image.h"
#include "tests/cli/driver.h"

namespace octrace::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

Outcome render(const Scratch& scratch, std::vector<std::string> more) {
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = {"render", "builtin:paper", "--size", "64x48", "--spp", "1", "--quiet"};
  launch.arguments.insert(launch.arguments.end(), more.begin(), more.end());
  return run(launch);
}

image::Image read(const std::string& path) {
  util::Result<image::Image> image = image::read(path, {});
  if (!image) throw std::runtime_error(image.error().to_string());
  return std::move(*image);
}

std::vector<std::string> names(const image::Image& image) {
  std::vector<std::string> out;
  for (const image::Image::Plane& plane : image.planes) out.push_back(plane.name);
  return out;
}

TEST(Output, NoFileReplacesAnotherOfTheSameCommand) {
  Scratch scratch;
  const std::string same = scratch.path("a.png");
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"-o", "a.png", "--stats", "./a.png"},
        std::vector<std::string>{"-o", "a.png", "-o", same}}) {
    const Outcome outcome = render(scratch, more);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_FALSE(std::filesystem::exists(same));
  }
  std::filesystem::copy_file(std::string(OCTRACE_SOURCE) + "/tests/data/triangle.gltf", same);
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = {"render", "a.png", "-o", "./a.png", "--size", "8x8"};
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("would replace"));
}

TEST(Output, OneExrHoldsEveryPlane) {
  Scratch scratch;
  const Outcome outcome = render(scratch, {"-o", "a.exr", "--aov", "all"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out + outcome.err, "");
  const image::Image image = read(scratch.path("a.exr"));
  EXPECT_EQ(image.width, 64u);
  EXPECT_EQ(image.height, 48u);
  EXPECT_THAT(names(image),
              UnorderedElementsAre("R", "G", "B", "A", "Z", "distance", "N.X", "N.Y", "N.Z", "Ng.X",
                                   "Ng.Y", "Ng.Z", "P.X", "P.Y", "P.Z", "albedo.R", "albedo.G",
                                   "albedo.B", "uv.X", "uv.Y", "bary.X", "bary.Y", "object_id",
                                   "material_id", "primitive_id", "mask", "motion.X", "motion.Y"));
  for (const image::Image::Plane& plane : image.planes) {
    EXPECT_EQ(plane.type == image::SampleType::uint32, plane.name.ends_with("_id")) << plane.name;
  }
  const auto& mask = image.find("mask")->floats;
  const auto& depth = image.find("Z")->floats;
  const auto& id = image.find("primitive_id")->uints;
  std::size_t hits = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    EXPECT_EQ(mask[i] == 1.0f, std::isfinite(depth[i]));
    EXPECT_EQ(mask[i] == 1.0f, id[i] != 0);
    hits += mask[i] == 1.0f;
  }
  EXPECT_GT(hits, 100u);
  EXPECT_LT(hits, mask.size());
}

TEST(Output, FilesNameTheirOwnPlanes) {
  Scratch scratch;
  const Outcome outcome =
      render(scratch, {"-o", "a.exr:Z,mask", "-o", "z.png:Z", "-o", "m.tif:mask", "-o", "b.png",
                       "-o", "n.jpg:normal", "-o", "i.png:primitive_id"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(scratch.files(), ElementsAre("a.exr", "b.png", "i.png", "m.tif", "n.jpg", "z.png"));
  const image::Image exr = read(scratch.path("a.exr"));
  EXPECT_THAT(names(exr), UnorderedElementsAre("Z", "mask"));
  EXPECT_EQ(read(scratch.path("b.png")).planes.size(), 4u);
  EXPECT_EQ(read(scratch.path("n.jpg")).planes.size(), 3u);

  // Millimetres in 16 bits, against the float plane of the same render.
  const image::Image depth = read(scratch.path("z.png"));
  const image::Image mask = read(scratch.path("m.tif"));
  ASSERT_EQ(depth.planes.size(), 1u);
  for (std::size_t i = 0; i < 64 * 48; ++i) {
    const double exact = std::floor(exr.find("Z")->floats[i] * 1000.0 + 0.5);
    EXPECT_EQ(std::lround(depth.planes[0].floats[i] * 65535.0), exact < 65535 ? exact : 65535.0);
    EXPECT_EQ(mask.planes[0].floats[i], exr.find("mask")->floats[i]);
  }
}

TEST(Output, OneNamedAovIsWhatAPngHolds) {
  Scratch scratch;
  ASSERT_EQ(render(scratch, {"-o", "z.png", "--aov", "Z", "--depth-scale", "10"}).exit_code, 0);
  const image::Image depth = read(scratch.path("z.png"));
  EXPECT_EQ(depth.planes.size(), 1u);
  const auto scale =
      std::find_if(depth.metadata.begin(), depth.metadata.end(),
                   [](const auto& entry) { return entry.first == "octrace:depth_scale"; });
  ASSERT_NE(scale, depth.metadata.end());
  EXPECT_EQ(scale->second, "10");
}

TEST(Output, TransparentBackgroundHasAlphaZero) {
  Scratch scratch;
  ASSERT_EQ(render(scratch, {"-o", "a.exr", "--background", "transparent"}).exit_code, 0);
  ASSERT_EQ(render(scratch, {"-o", "b.exr", "--sky", "0,0,0.5"}).exit_code, 0);
  const image::Image clear = read(scratch.path("a.exr"));
  const image::Image sky = read(scratch.path("b.exr"));
  EXPECT_EQ(clear.find("A")->floats[0], 0.0f);
  EXPECT_EQ(sky.find("A")->floats[0], 1.0f);
  EXPECT_EQ(sky.find("R")->floats[0], 0.0f);
  EXPECT_EQ(sky.find("B")->floats[0], 0.5f);
}

TEST(Unwritable, IsFoundBeforeRendering) {
  Scratch scratch;
  write_text(scratch.path("file"), "");
  std::filesystem::create_directory(scratch.path("folder.exr"));
  for (const char* path : {"missing/a.exr", "file/a.exr", "folder.exr", "/proc/a.exr"}) {
    const Outcome outcome = render(scratch, {"-o", path});
    EXPECT_EQ(outcome.exit_code, 5) << path << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(path));
  }
  EXPECT_EQ(render(scratch, {"-o", "a.exr", "--stats", "missing/s.json"}).exit_code, 5);
  EXPECT_THAT(scratch.files(), ElementsAre("file", "folder.exr"));
}

TEST(Unwritable, FolderWithoutPermission) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write anywhere";
  Scratch scratch;
  std::filesystem::permissions(
      scratch.folder(), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_EQ(render(scratch, {"-o", "a.exr"}).exit_code, 5);
  std::filesystem::permissions(scratch.folder(), std::filesystem::perms::owner_all);
}

// Every length at which writing may break off, for every writer: a limit on the file's size fails
// as a full disk does.
class FullDisk : public ::testing::TestWithParam<const char*> {};

TEST_P(FullDisk, LeavesNothing) {
  Scratch whole;
  const std::string name = GetParam();
  ASSERT_EQ(render(whole, {"-o", name}).exit_code, 0);
  const auto size = std::filesystem::file_size(whole.path(name));
  for (const std::uint64_t limit : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{100},
                                    std::uint64_t{size / 2}, std::uint64_t{size - 1}}) {
    Scratch scratch;
    Launch launch;
    launch.folder = scratch.folder();
    launch.largest_file = limit;
    launch.arguments = {"render", "builtin:paper", "--size", "64x48", "--spp", "1", "-o", name};
    const Outcome outcome = run(launch);
    EXPECT_EQ(outcome.exit_code, 5) << "at " << limit << " of " << size << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(name + ": IO_ERROR: "));
    EXPECT_THAT(scratch.files(), IsEmpty());
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, FullDisk,
                         ::testing::Values("a.exr", "a.png", "a.tif", "a.jpg", "a.npy", "a.npz"));

TEST(FullDisk, KeepsTheFileThatWasThere) {
  Scratch scratch;
  write_text(scratch.path("a.exr"), "precious");
  Launch launch;
  launch.folder = scratch.folder();
  launch.largest_file = 200;
  launch.arguments = {"render", "builtin:paper", "--size", "64x48", "--spp", "1", "-o", "a.exr"};
  EXPECT_EQ(run(launch).exit_code, 5);
  EXPECT_EQ(read_text(scratch.path("a.exr")), "precious");
  EXPECT_THAT(scratch.files(), ElementsAre("a.exr"));
}

TEST(FullDisk, StatsToo) {
  Scratch scratch;
  Launch launch;
  launch.folder = scratch.folder();
  launch.largest_file = 600;
  launch.arguments = {"render", "builtin:paper", "--size",  "2x2",   "--spp", "1",
                      "-o",     "a.png",         "--stats", "s.json"};
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.err, HasSubstr("s.json: IO_ERROR"));
  EXPECT_THAT(scratch.files(), ElementsAre("a.png"));
}

TEST(Ids, BeyondSixteenBitsAreAnErrorInAPng) {
  Scratch scratch;
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = {"render", "builtin:terrain:256", "--size", "32x32",
                      "-o",     "i.png:primitive_id"};
  const Outcome outcome = run(launch);
  EXPECT_EQ(outcome.exit_code, 6);
  EXPECT_THAT(outcome.err, HasSubstr("does not fit"));
  EXPECT_THAT(scratch.files(), IsEmpty());
}

}  // namespace
}  // namespace octrace::test
