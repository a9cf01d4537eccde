#include <gtest/gtest.h>

#include <memory>

#include "backend/util/result.h"

namespace octrace::test {
namespace {

TEST(Error, ReadsAsFilePointerCodeMessage) {
  util::Error error{util::Exit::invalid_input, "ACCESSOR_TOO_LONG",
                    "needs 4800 bytes, bufferView 2 has 4096", "scene.gltf", "/accessors/3"};
  EXPECT_EQ(error.to_string(),
            "scene.gltf#/accessors/3: ACCESSOR_TOO_LONG: needs 4800 bytes, bufferView 2 has 4096");
  error.pointer.clear();
  EXPECT_EQ(error.to_string(),
            "scene.gltf: ACCESSOR_TOO_LONG: needs 4800 bytes, bufferView 2 has 4096");
  error.file.clear();
  error.code.clear();
  EXPECT_EQ(error.to_string(), "needs 4800 bytes, bufferView 2 has 4096");
}

TEST(Result, HoldsAValueOrAnError) {
  util::Result<std::unique_ptr<int>> value(std::make_unique<int>(5));
  ASSERT_TRUE(value);
  EXPECT_EQ(**value, 5);
  const std::unique_ptr<int> moved = *std::move(value);
  EXPECT_EQ(*moved, 5);
  const util::Result<int> failed(util::Error{util::Exit::limit, "", "too much", "", ""});
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().exit, util::Exit::limit);
  EXPECT_TRUE(util::Result<void>());
  EXPECT_FALSE(util::Result<void>(util::Error{}));
}

}  // namespace
}  // namespace octrace::test
