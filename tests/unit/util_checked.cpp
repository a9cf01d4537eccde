#include <gtest/gtest.h>

#include <limits>

#include "backend/util/checked.h"

namespace octrace::test {
namespace {

constexpr std::uint64_t kLargest = std::numeric_limits<std::uint64_t>::max();

TEST(Checked, Multiply) {
  EXPECT_EQ(util::checked_mul(6, 7), 42u);
  EXPECT_EQ(util::checked_mul(kLargest, 1), kLargest);
  EXPECT_EQ(util::checked_mul(kLargest, 0), 0u);
  EXPECT_FALSE(util::checked_mul(kLargest, 2));
  EXPECT_FALSE(util::checked_mul(1ull << 32, 1ull << 32));
}

TEST(Checked, Add) {
  EXPECT_EQ(util::checked_add(1, 2), 3u);
  EXPECT_EQ(util::checked_add(kLargest, 0), kLargest);
  EXPECT_FALSE(util::checked_add(kLargest, 1));
}

}  // namespace
}  // namespace octrace::test
