#include "backend/gltf/uri.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "tests/malformed/base_scene.h"

namespace octrace::gltf {
namespace {

std::string decoded(const std::string& uri) {
  const auto data = decode_data_uri(uri);
  return data ? std::string(data->bytes.begin(), data->bytes.end()) : data.error().code;
}

// RFC 4648, section 10.
TEST(DataUri, Base64TestVectors) {
  EXPECT_EQ(decoded("data:;base64,"), "");
  EXPECT_EQ(decoded("data:;base64,Zg=="), "f");
  EXPECT_EQ(decoded("data:;base64,Zm8="), "fo");
  EXPECT_EQ(decoded("data:;base64,Zm9v"), "foo");
  EXPECT_EQ(decoded("data:;base64,Zm9vYg=="), "foob");
  EXPECT_EQ(decoded("data:;base64,Zm9vYmE="), "fooba");
  EXPECT_EQ(decoded("data:;base64,Zm9vYmFy"), "foobar");
}

TEST(DataUri, Base64RoundTrip) {
  std::mt19937 random(1);
  for (std::size_t size = 0; size < 300; ++size) {
    std::vector<std::uint8_t> bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    const auto data = decode_data_uri(tests::data_uri(bytes));
    ASSERT_TRUE(data) << size;
    EXPECT_EQ(data->bytes, bytes) << size;
  }
}

TEST(DataUri, FormsOfRfc2397) {
  EXPECT_EQ(decoded("data:,a%20brief%20note"), "a brief note");
  EXPECT_EQ(decoded("DATA:text/plain;charset=utf-8;base64,Zm9v"), "foo");
  EXPECT_EQ(decoded("data:;charset=utf-8,x"), "x");
  EXPECT_EQ(decoded("data:;base64,Zm9vYg%3D%3D"), "foob");
  EXPECT_EQ(decode_data_uri("data:Image/PNG;base64,")->mime, "image/png");
  EXPECT_EQ(decode_data_uri("data:a/b;c=d,")->mime, "a/b");
  EXPECT_FALSE(is_data_uri("data"));
  EXPECT_FALSE(is_data_uri("database.bin"));
  for (const char* uri : {"data:", "data:base64", "data:;;base64,AA==", "data:/b,", "data:a/,",
                          "data:a/b;c,", "data:a b/c,", "data:;base64,A", "data:;base64,AA=",
                          "data:;base64,=AAA", "data:;base64,AA-_", "data:,%"}) {
    EXPECT_EQ(decoded(uri), "INVALID_URI") << uri;
  }
}

std::string path_of(const std::string& uri) {
  const auto path = relative_path(uri);
  return path ? *path : "!" + path.error().code;
}

TEST(RelativePath, StaysBelow) {
  EXPECT_EQ(path_of("a.bin"), "a.bin");
  EXPECT_EQ(path_of("./a//b/./c.bin"), "a/b/c.bin");
  EXPECT_EQ(path_of("a/../b.bin"), "b.bin");
  EXPECT_EQ(path_of("a%20b%2Fc.bin"), "a b/c.bin");
  EXPECT_EQ(path_of("%C3%A9.png"), "\xc3\xa9.png");
  EXPECT_EQ(path_of("..a"), "..a");
  EXPECT_EQ(path_of("a:b"), "!NON_RELATIVE_URI");
  EXPECT_EQ(path_of("1:b"), "1:b");
  EXPECT_EQ(path_of("a/b:c"), "a/b:c");
  EXPECT_EQ(path_of("/etc/passwd"), "!NON_RELATIVE_URI");
  EXPECT_EQ(path_of("%2fetc"), "!NON_RELATIVE_URI");
  for (const char* uri : {"", "..", "a/../..", "a/../../b", "%2e%2e/b", ".", "a/..", "%00", "a%0ab",
                          "%", "%1", "%g0"}) {
    EXPECT_EQ(path_of(uri), "!INVALID_URI") << uri;
  }
}

}  // namespace
}  // namespace octrace::gltf
