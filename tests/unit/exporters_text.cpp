#include "exporters/text.h"

#include <gtest/gtest.h>

namespace octrace::test {
namespace {

using exporters::comment_text;
using exporters::identifier;
using exporters::path_parts;

TEST(ExporterText, IdentifiersHoldWordCharactersOnly) {
  EXPECT_EQ(identifier("Wheel_01"), "Wheel_01");
  EXPECT_EQ(identifier("a b-c.d\"}"), "a_b_c_d__");
  EXPECT_EQ(identifier("naïve"), "na__ve");
  EXPECT_EQ(identifier(std::string(100, 'x')).size(), 24u);
}

TEST(ExporterText, CommentsStayOnOneLineAndCannotEnd) {
  const std::string text = comment_text("a\n#error */ \\ \x01 \xff");
  EXPECT_EQ(text, "a\\x0a#error \\x2a/ \\x5c \\x01 \\xff");
  EXPECT_LT(comment_text(std::string(100000, 'y')).size(), 300u);
}

TEST(ExporterText, PathsSplitAtTheLastSlashAndDot) {
  const auto parts = path_parts("/tmp/out dir/a b'$(x).v2.pov");
  EXPECT_EQ(parts.folder, "/tmp/out dir/");
  EXPECT_EQ(parts.name, "a b'$(x).v2.pov");
  EXPECT_EQ(parts.stem, "a b'$(x).v2");
  EXPECT_EQ(parts.safe_stem, "a_b___x_.v2");
  EXPECT_EQ(path_parts("plain").stem, "plain");
  EXPECT_EQ(path_parts("dir.d/.hidden").stem, ".hidden");
}

}  // namespace
}  // namespace octrace::test
