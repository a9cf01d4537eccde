// Arrays for NumPy, against the EXR of the same command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "backend/image/image.h"
#include "tests/cli/driver.h"
#include "tests/unit/zip_reader.h"

namespace octrace::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Outcome render(const Scratch& scratch, const std::vector<std::string>& more) {
  Launch launch;
  launch.folder = scratch.folder();
  launch.arguments = {"render", "builtin:default", "--size", "64x48", "--spp", "1", "--quiet"};
  launch.arguments.insert(launch.arguments.end(), more.begin(), more.end());
  return run(launch);
}

struct NpyFile {
  std::string header, data;
};

NpyFile parse(const std::string& file) {
  const auto length =
      static_cast<unsigned char>(file.at(8)) + 256u * static_cast<unsigned char>(file.at(9));
  return {file.substr(10, length), file.substr(10 + length)};
}

// Value i of channel c of an array of `channels`, as the EXR's plane holds it.
std::uint32_t word(const std::string& data, std::size_t i) {
  std::uint32_t value = 0;
  std::memcpy(&value, data.data() + 4 * i, 4);
  return value;
}

std::uint32_t word(const image::Image::Plane& plane, std::size_t i) {
  std::uint32_t value = 0;
  if (plane.type == image::SampleType::uint32) return plane.uints[i];
  std::memcpy(&value, &plane.floats[i], 4);
  return value;
}

TEST(Numpy, ArraysHoldTheBitsOfTheExr) {
  Scratch scratch;
  const Outcome outcome =
      render(scratch, {"-o", "a.exr", "-o", "a.npz", "-o", "z.npy:Z", "--aov", "all"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const util::Result<image::Image> exr = image::read(scratch.path("a.exr"), {});
  ASSERT_TRUE(exr);
  const auto arrays = read_zip(read_text(scratch.path("a.npz")));
  std::size_t channels_seen = 0;
  const std::vector<std::pair<std::string, std::vector<std::string>>> expected = {
      {"RGBA", {"R", "G", "B", "A"}},
      {"Z", {"Z"}},
      {"distance", {"distance"}},
      {"N", {"N.X", "N.Y", "N.Z"}},
      {"Ng", {"Ng.X", "Ng.Y", "Ng.Z"}},
      {"P", {"P.X", "P.Y", "P.Z"}},
      {"albedo", {"albedo.R", "albedo.G", "albedo.B"}},
      {"uv", {"uv.X", "uv.Y"}},
      {"bary", {"bary.X", "bary.Y"}},
      {"object_id", {"object_id"}},
      {"material_id", {"material_id"}},
      {"primitive_id", {"primitive_id"}}};
  for (const auto& [name, channels] : expected) {
    ASSERT_TRUE(arrays.contains(name + ".npy")) << name;
    const NpyFile array = parse(arrays.at(name + ".npy"));
    const std::size_t count = channels.size();
    EXPECT_THAT(array.header, HasSubstr(count == 1 ? "'shape': (48, 64), "
                                                   : "'shape': (48, 64, " + std::to_string(count)));
    EXPECT_THAT(array.header, HasSubstr(name.ends_with("_id") ? "'<u4'" : "'<f4'"));
    ASSERT_EQ(array.data.size(), 64u * 48 * 4 * count) << name;
    for (std::size_t c = 0; c < count; ++c) {
      const image::Image::Plane* plane = exr->find(channels[c]);
      ASSERT_NE(plane, nullptr) << channels[c];
      for (std::size_t i = 0; i < 64 * 48; ++i) {
        ASSERT_EQ(word(array.data, i * count + c), word(*plane, i)) << channels[c] << " " << i;
      }
      ++channels_seen;
    }
  }
  const NpyFile mask = parse(arrays.at("mask.npy"));
  EXPECT_THAT(mask.header, HasSubstr("'|b1'"));
  ASSERT_EQ(mask.data.size(), 64u * 48);
  for (std::size_t i = 0; i < 64 * 48; ++i) {
    ASSERT_EQ(mask.data[i], exr->find("mask")->floats[i] == 1.0f ? 1 : 0) << i;
  }
  EXPECT_GE(exr->planes.size(), channels_seen + 1);
  EXPECT_EQ(parse(read_text(scratch.path("z.npy"))).data, parse(arrays.at("Z.npy")).data);
}

TEST(Numpy, EqualCommandsGiveEqualFiles) {
  Scratch scratch;
  ASSERT_EQ(render(scratch, {"-o", "a.npz", "--aov", "Z,N", "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(render(scratch, {"-o", "b.npz", "--aov", "Z,N", "--tile", "7"}).exit_code, 0);
  EXPECT_EQ(read_text(scratch.path("a.npz")), read_text(scratch.path("b.npz")));
}

TEST(Numpy, AnArrayFileHoldsOneAov) {
  Scratch scratch;
  const Outcome two = render(scratch, {"-o", "a.npy:Z,mask"});
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.err, HasSubstr("holds one AOV, 2 were named"));
  ASSERT_EQ(render(scratch, {"-o", "p.npy:P", "-o", "beauty.npy"}).exit_code, 0);
  EXPECT_THAT(parse(read_text(scratch.path("p.npy"))).header, HasSubstr("(48, 64, 3)"));
  EXPECT_THAT(parse(read_text(scratch.path("beauty.npy"))).header, HasSubstr("(48, 64, 4)"));
  EXPECT_THAT(scratch.files(), ElementsAre("beauty.npy", "p.npy"));
}

// No image library takes part.
TEST(Numpy, NeedsNoImageLibrary) {
  Scratch scratch;
  std::filesystem::create_directory(scratch.path("bin"));
  std::filesystem::copy_file(OCTRACE_PROGRAM, scratch.path("bin/octrace"));
  std::filesystem::permissions(scratch.path("bin/octrace"), std::filesystem::perms::owner_all);
  Launch launch;
  launch.folder = scratch.folder();
  launch.program = scratch.path("bin/octrace");
  launch.arguments = {"render", "builtin:paper", "-o", "a.npz:Z", "--size", "8x8", "--quiet"};
  EXPECT_EQ(run(launch).exit_code, 0);
  launch.arguments = {"render", "builtin:paper", "-o", "a.exr:Z", "--size", "8x8", "--quiet"};
  const Outcome exr = run(launch);
  EXPECT_EQ(exr.exit_code, 5) << exr.err;
}

}  // namespace
}  // namespace octrace::test
