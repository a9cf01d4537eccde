#include "backend/image/npy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "backend/image/zip.h"
#include "backend/util/output_file.h"
#include "tests/unit/zip_reader.h"

namespace octrace::test {
namespace {

using image::Array;
using image::ArrayType;
using image::Packing;
using ::testing::HasSubstr;

class Npy : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("octrace_npy_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  std::string content(const char* name) const {
    std::ifstream file(folder_ / name, std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }
  std::filesystem::path folder_;
};

// Of a .npy file: its header's text and what follows it.
std::pair<std::string, std::string> split(const std::string& file) {
  EXPECT_EQ(file.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  const auto length =
      static_cast<unsigned char>(file[8]) + 256u * static_cast<unsigned char>(file[9]);
  EXPECT_EQ((10 + length) % 64, 0u);
  EXPECT_EQ(file[10 + length - 1], '\n');
  return {file.substr(10, length), file.substr(10 + length)};
}

std::string bytes_of(const auto& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0])};
}

TEST_F(Npy, HeaderAndDataAreAsTheFormatSays) {
  const std::vector<float> depth = {1.5f,  std::numeric_limits<float>::infinity(),
                                    -0.0f, std::numeric_limits<float>::denorm_min(),
                                    4,     5};
  const std::vector<std::uint32_t> id = {0, 0xffffffffu, 7};
  const std::vector<std::uint8_t> mask = {0, 1, 1, 0};
  ASSERT_TRUE(image::write_npy(path("z.npy"), {"Z", ArrayType::float32, {2, 3}, depth.data()}));
  ASSERT_TRUE(image::write_npy(path("n.npy"), {"N", ArrayType::float32, {1, 2, 3}, depth.data()}));
  ASSERT_TRUE(image::write_npy(path("i.npy"), {"i", ArrayType::uint32, {3}, id.data()}));
  ASSERT_TRUE(image::write_npy(path("m.npy"), {"m", ArrayType::boolean, {4, 1}, mask.data()}));
  const auto z = split(content("z.npy")), n = split(content("n.npy")), i = split(content("i.npy")),
             m = split(content("m.npy"));
  EXPECT_THAT(z.first, HasSubstr("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }"));
  EXPECT_THAT(n.first, HasSubstr("'shape': (1, 2, 3), }"));
  EXPECT_THAT(i.first, HasSubstr("{'descr': '<u4', 'fortran_order': False, 'shape': (3,), }"));
  EXPECT_THAT(m.first, HasSubstr("'descr': '|b1', 'fortran_order': False, 'shape': (4, 1), }"));
  EXPECT_EQ(z.second, bytes_of(depth));
  EXPECT_EQ(n.second, bytes_of(depth));
  EXPECT_EQ(i.second, bytes_of(id));
  EXPECT_EQ(m.second, bytes_of(mask));
}

TEST_F(Npy, AnArchiveHoldsEveryArrayStoredOrDeflated) {
  std::vector<float> noise(37 * 531 * 3);
  std::uint32_t state = 1;
  for (float& value : noise) {
    state = state * 1664525u + 1013904223u;
    value = static_cast<float>(state);
  }
  const std::vector<std::uint32_t> flat(37 * 531, 3);
  const std::vector<Array> arrays = {{"N", ArrayType::float32, {531, 37, 3}, noise.data()},
                                     {"object_id", ArrayType::uint32, {531, 37}, flat.data()},
                                     {"none", ArrayType::uint32, {0, 37}, flat.data()}};
  std::vector<std::uintmax_t> sizes;
  for (const Packing packing : {Packing::stored, Packing::deflated}) {
    ASSERT_TRUE(image::write_npz(path("a.npz"), arrays, packing));
    const auto members = read_zip(content("a.npz"));
    ASSERT_EQ(members.size(), 3u);
    EXPECT_EQ(split(members.at("N.npy")).second, bytes_of(noise));
    EXPECT_EQ(split(members.at("object_id.npy")).second, bytes_of(flat));
    EXPECT_EQ(split(members.at("none.npy")).second, "");
    sizes.push_back(std::filesystem::file_size(path("a.npz")));
  }
  EXPECT_LT(sizes[1], sizes[0] - flat.size() * 3);
}

TEST_F(Npy, EqualArraysAreEqualFiles) {
  const std::vector<float> values = {1, 2, 3};
  const std::vector<Array> arrays = {{"a", ArrayType::float32, {3}, values.data()}};
  ASSERT_TRUE(image::write_npz(path("a.npz"), arrays, Packing::deflated));
  ASSERT_TRUE(image::write_npz(path("b.npz"), arrays, Packing::deflated));
  EXPECT_EQ(content("a.npz"), content("b.npz"));
}

// Archives that need ZIP64 are too large for a test, but its records are allowed in small ones.
TEST_F(Npy, Zip64RecordsHoldSizesOffsetsAndCounts) {
  const std::string text(1000, 'x');
  const std::vector<std::string_view> parts = {text, "y"};
  struct Case {
    image::ZipWriter::Zip64From from;
    const char* what;
  };
  for (const Case& c :
       {Case{{0, 0}, "everything"}, Case{{500, 0xffff}, "sizes"},
        Case{{1500, 2}, "late offsets and the count"}, Case{{100, 3}, "all sizes"}}) {
    for (const Packing packing : {Packing::stored, Packing::deflated}) {
      auto file = util::OutputFile::create(path("a.zip"));
      ASSERT_TRUE(file);
      image::ZipWriter zip(*file, c.from);
      for (const char* name : {"a", "b", "c"}) ASSERT_TRUE(zip.add(name, parts, packing));
      ASSERT_TRUE(zip.finish());
      ASSERT_TRUE(file->commit());
      const auto members = read_zip(content("a.zip"));
      ASSERT_EQ(members.size(), 3u) << c.what;
      for (const auto& [name, value] : members) EXPECT_EQ(value, text + "y") << c.what;
      if (std::system("command -v /usr/bin/python3 >/dev/null") == 0) {
        EXPECT_EQ(std::system(
                      ("/usr/bin/python3 -m zipfile -t " + path("a.zip") + " >/dev/null").c_str()),
                  0)
            << c.what;
      }
    }
  }
}

TEST_F(Npy, AnEmptyArchiveIsOne) {
  ASSERT_TRUE(image::write_npz(path("a.npz"), {}, Packing::deflated));
  EXPECT_TRUE(read_zip(content("a.npz")).empty());
}

TEST_F(Npy, FailuresLeaveNothing) {
  const std::vector<float> values = {1, 2, 3};
  const auto missing =
      image::write_npy(path("no/a.npy"), {"a", ArrayType::float32, {3}, values.data()});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().exit, util::Exit::io);
  const auto huge = image::write_npy(
      path("a.npy"), {"a", ArrayType::float32, {1ull << 40, 1ull << 40}, values.data()});
  ASSERT_FALSE(huge);
  EXPECT_EQ(huge.error().exit, util::Exit::limit);
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

// np.load() as users call it.
TEST_F(Npy, NumpyLoadsThem) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0) {
    GTEST_SKIP() << "python3-numpy is not installed";
  }
  std::vector<float> values(4 * 5 * 3);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i) * 0.5f;
  const std::vector<std::uint32_t> id = {1, 2, 4000000000u};
  const std::vector<std::uint8_t> mask = {0, 1, 1, 0};
  const std::vector<Array> arrays = {{"N", ArrayType::float32, {4, 5, 3}, values.data()},
                                     {"object_id", ArrayType::uint32, {3, 1}, id.data()},
                                     {"mask", ArrayType::boolean, {2, 2}, mask.data()}};
  ASSERT_TRUE(image::write_npz(path("a.npz"), arrays, Packing::deflated));
  ASSERT_TRUE(image::write_npz(path("b.npz"), arrays, Packing::stored));
  ASSERT_TRUE(image::write_npy(path("n.npy"), arrays[0]));
  std::ofstream(path("check.py")) << R"(
import numpy as np, sys
for name in ("a.npz", "b.npz"):
    z = np.load(name)
    assert sorted(z.files) == ["N", "mask", "object_id"], z.files
    assert z["N"].dtype == np.float32 and z["N"].shape == (4, 5, 3)
    assert (z["N"].ravel() == np.arange(60) * 0.5).all()
    assert z["object_id"].dtype == np.uint32 and z["object_id"].tolist() == [[1], [2], [4000000000]]
    assert z["mask"].dtype == bool and z["mask"].tolist() == [[False, True], [True, False]]
assert (np.load("n.npy", mmap_mode="r") == np.load("a.npz")["N"]).all()
)";
  EXPECT_EQ(std::system(("cd " + folder_.string() + " && /usr/bin/python3 check.py").c_str()), 0);
}

}  // namespace
}  // namespace octrace::test
