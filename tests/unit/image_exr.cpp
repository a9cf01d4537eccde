#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "backend/image/image.h"

namespace octrace::test {
namespace {

class Exr : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("octrace_exr_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  std::filesystem::path folder_;
};

// Odd sizes and enough rows to cross the writer's blocks.
constexpr std::uint32_t kWidth = 37, kHeight = 531;

struct Planes {
  std::vector<float> color = std::vector<float>(kWidth * kHeight * 4);  // interleaved
  std::vector<float> depth = std::vector<float>(kWidth * kHeight);
  std::vector<std::uint32_t> id = std::vector<std::uint32_t>(kWidth * kHeight);

  Planes() {
    std::uint32_t state = 1;
    const auto next = [&] { return state = state * 1664525u + 1013904223u; };
    for (float& value : color) value = static_cast<float>(next()) * 1e-9f;
    for (float& value : depth) value = static_cast<float>(next()) * 1e-3f;
    for (std::uint32_t& value : id) value = next();
    depth[0] = std::numeric_limits<float>::infinity();
    depth[1] = -0.0f;
    depth[2] = std::numeric_limits<float>::denorm_min();
    depth[3] = std::numeric_limits<float>::max();
    depth[4] = std::numeric_limits<float>::quiet_NaN();
    id[0] = 0;
    id[1] = 0xffffffffu;
    id[2] = 0x80000001u;  // no float holds it
  }

  image::ImageView view() const {
    image::ImageView view{kWidth, kHeight, {}, {{"octrace:version", "1.2.3"}}};
    const char* names[] = {"R", "G", "B", "A"};
    for (int c = 0; c < 4; ++c) {
      view.channels.push_back({names[c], image::SampleType::float32, color.data() + c, 16});
    }
    view.channels.push_back({"Z", image::SampleType::float32, depth.data(), 4});
    view.channels.push_back({"primitive_id", image::SampleType::uint32, id.data(), 4});
    return view;
  }
};

TEST_F(Exr, MixedPlanesComeBackBitForBit) {
  const Planes planes;
  ASSERT_TRUE(image::write_exr(path("a.exr"), planes.view()));
  const util::Result<image::Image> image = image::read(path("a.exr"), {});
  ASSERT_TRUE(image) << image.error().to_string();
  EXPECT_EQ(image->width, kWidth);
  EXPECT_EQ(image->height, kHeight);
  ASSERT_EQ(image->planes.size(), 6u);
  EXPECT_EQ(
      std::memcmp(image->find("Z")->floats.data(), planes.depth.data(), planes.depth.size() * 4),
      0);
  EXPECT_EQ(image->find("primitive_id")->uints, planes.id);
  const char* names[] = {"R", "G", "B", "A"};
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_EQ(image->find(names[c])->floats[i], planes.color[i * 4 + c]);
    }
  }
  EXPECT_THAT(image->metadata, ::testing::Contains(::testing::Pair("octrace:version", "1.2.3")));
  EXPECT_EQ(image->find("nothing"), nullptr);
}

TEST_F(Exr, EqualPixelsAreEqualBytesAtAnyTime) {
  const auto bytes = [&](const char* name) {
    std::ifstream file(path(name), std::ios::binary);
    return std::string((std::istreambuf_iterator<char>(file)), {});
  };
  const Planes planes;
  ASSERT_TRUE(image::set_threads(1));
  ASSERT_TRUE(image::write_exr(path("a.exr"), planes.view()));
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // a date would have changed
  ASSERT_TRUE(image::set_threads(3));
  ASSERT_TRUE(image::write_exr(path("b.exr"), planes.view()));
  EXPECT_EQ(bytes("a.exr"), bytes("b.exr"));
  EXPECT_GT(bytes("a.exr").size(), 1000u);
}

TEST_F(Exr, FolderThatIsNotThere) {
  const util::Result<void> written = image::write_exr(path("missing/a.exr"), Planes().view());
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().exit, util::Exit::io);
  EXPECT_EQ(written.error().file, path("missing/a.exr"));
}

TEST_F(Exr, ReadRefusesWhatItCannotTrust) {
  EXPECT_EQ(image::read(path("none.exr"), {}).error().exit, util::Exit::io);
  EXPECT_EQ(image::read(folder_.string(), {}).error().exit, util::Exit::io);
  std::ofstream(path("text.exr")) << "not an image at all";
  EXPECT_EQ(image::read(path("text.exr"), {}).error().exit, util::Exit::invalid_input);
  std::ofstream(path("text.bin")) << "not an image at all";
  EXPECT_EQ(image::read(path("text.bin"), {}).error().exit, util::Exit::unsupported);
  ASSERT_TRUE(image::write_exr(path("a.exr"), Planes().view()));
  util::Limits limits;
  limits.max_image_pixels = 100;
  const util::Result<image::Image> limited = image::read(path("a.exr"), limits);
  ASSERT_FALSE(limited);
  EXPECT_EQ(limited.error().exit, util::Exit::limit);
  std::filesystem::resize_file(path("a.exr"), std::filesystem::file_size(path("a.exr")) / 2);
  EXPECT_EQ(image::read(path("a.exr"), {}).error().exit, util::Exit::invalid_input);
}

}  // namespace
}  // namespace octrace::test
