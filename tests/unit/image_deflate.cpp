#include "backend/image/deflate.h"

#include <dlfcn.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

namespace octrace::test {
namespace {

std::string noise(std::size_t size) {
  std::string bytes(size, '\0');
  std::uint32_t state = 1;
  for (char& byte : bytes) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<char>(state >> 24);
  }
  return bytes;
}

// A plane: background, and a surface whose depth changes slowly.
std::string depths(std::size_t pixels, std::uint32_t seed = 0) {
  std::vector<float> plane(pixels, 1e10f);
  for (std::size_t i = pixels / 3; i < pixels; ++i) {
    seed = seed * 1664525u + 1013904223u;
    plane[i] = 20.0f + static_cast<float>(i % 640) * 0.01f + static_cast<float>(seed >> 28) * 1e-5f;
  }
  return {reinterpret_cast<const char*>(plane.data()), pixels * 4};
}

std::vector<std::string> samples() {
  return {"",
          "a",
          std::string(12, '\0'),
          std::string(100000, 'x'),
          noise(100),
          noise(3000000),
          depths(640 * 16),
          depths(2000000)};
}

std::string deflated(const std::vector<std::string_view>& parts) {
  std::string stream;
  const auto outcome = image::deflate(parts, [&](std::string_view piece) {
    stream += piece;
    return util::Result<void>();
  });
  EXPECT_TRUE(outcome);
  return stream;
}

// By zlib.
std::string inflated(const std::string& stream, std::size_t size) {
  std::string bytes(size + 1, '\0');
  z_stream z{};
  EXPECT_EQ(::inflateInit2(&z, -15), Z_OK);
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(stream.data()));
  z.avail_in = static_cast<uInt>(stream.size());
  z.next_out = reinterpret_cast<Bytef*>(bytes.data());
  z.avail_out = static_cast<uInt>(bytes.size());
  EXPECT_EQ(::inflate(&z, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(z.avail_in, 0u);
  bytes.resize(z.total_out);
  ::inflateEnd(&z);
  return bytes;
}

TEST(Deflate, ZlibReadsIt) {
  for (const std::string& sample : samples()) {
    const std::string stream = deflated({sample});
    EXPECT_EQ(inflated(stream, sample.size()), sample) << sample.size();
    // zip.cpp reckons with no more.
    EXPECT_LE(stream.size(), sample.size() + sample.size() / 64 + 64);
  }
}

TEST(Deflate, PartsAreOneStream) {
  const std::string sample = depths(300000) + noise(70000);
  const std::string_view all = sample;
  const std::string stream =
      deflated({all.substr(0, 1), "", all.substr(1, 99999), all.substr(100000)});
  EXPECT_EQ(inflated(stream, sample.size()), sample);
  EXPECT_EQ(inflated(deflated({}), 0), "");
}

// In any thread, after any other stream, and wherever memory is.
TEST(Deflate, EqualPartsAreEqualStreams) {
  std::vector<std::string> inputs, streams;
  for (std::uint32_t i = 0; i < 60; ++i) {
    inputs.push_back(depths(20000, i) + noise(i * 100));
    streams.push_back(deflated({inputs.back()}));
  }
  std::atomic<int> different{0};
  std::vector<std::thread> threads;
  for (std::size_t thread = 0; thread < 16; ++thread) {
    threads.emplace_back([&, thread] {
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        const std::size_t at = (i * 7 + thread) % inputs.size();
        different += deflated({inputs[at]}) != streams[at];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(different, 0);
}

TEST(Deflate, AnErrorOfTheSinkEndsIt) {
  const std::string sample = noise(3000000);
  const std::vector<std::string_view> parts = {sample};
  int calls = 0;
  const auto outcome = image::deflate(parts, [&](std::string_view) -> util::Result<void> {
    ++calls;
    return util::Error{util::Exit::io, "", "full", "", ""};
  });
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().message, "full");
  EXPECT_EQ(calls, 1);
  // The thread's next stream does not know of it.
  EXPECT_EQ(inflated(deflated({"abc"}), 3), "abc");
}

// OpenEXR's, where this process has one of its own in the place of zlib's.
class Compress2 : public ::testing::Test {
 protected:
  void SetUp() override {
    Dl_info own, found;
    ASSERT_NE(::dladdr(reinterpret_cast<void*>(&samples), &own), 0);
    void* const symbol = ::dlsym(RTLD_DEFAULT, "compress2");
    ASSERT_NE(::dladdr(symbol, &found), 0);
    if (found.dli_fbase != own.dli_fbase) GTEST_SKIP() << "built without ISA-L";
    deflated({});  // as every program does that writes images
  }
  static std::string compressed(const std::string& bytes, std::size_t room, int level,
                                int outcome) {
    std::string packed(room, '\0');
    uLongf size = room;
    const auto function =
        reinterpret_cast<decltype(&::compress2)>(::dlsym(RTLD_DEFAULT, "compress2"));
    EXPECT_EQ(function(reinterpret_cast<Bytef*>(packed.data()), &size,
                       reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), level),
              outcome);
    packed.resize(size);
    return packed;
  }
};

TEST_F(Compress2, ZlibReadsIt) {
  for (const std::string& sample : samples()) {
    for (const int level : {0, 1, 4, 9, -1}) {
      // As much room as OpenEXR gives.
      const std::string packed =
          compressed(sample, sample.size() + sample.size() / 100 + 100, level, Z_OK);
      std::string bytes(sample.size() + 1, '\0');
      uLongf size = bytes.size();
      EXPECT_EQ(::uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                             reinterpret_cast<const Bytef*>(packed.data()), packed.size()),
                Z_OK);
      bytes.resize(size);
      EXPECT_EQ(bytes, sample) << sample.size() << " at level " << level;
    }
  }
}

TEST_F(Compress2, SaysWhereThereIsTooLittleRoom) {
  for (const int level : {1, 4}) {
    for (const std::size_t room : {0, 5, 99000})
      compressed(noise(100000), room, level, Z_BUF_ERROR);
  }
}

}  // namespace
}  // namespace octrace::test
