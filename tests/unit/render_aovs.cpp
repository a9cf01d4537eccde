#include <gtest/gtest.h>

#include <set>

#include "backend/render/framebuffer.h"

namespace octrace::render {
namespace {

TEST(Aovs, TableIsInOrderAndChannelsAreUnique) {
  std::set<std::string_view> channels, options;
  int index = 0;
  for (const AovInfo& info : aov_table()) {
    EXPECT_EQ(static_cast<int>(info.aov), index++);
    EXPECT_EQ(&aov_info(info.aov), &info);
    EXPECT_TRUE(options.insert(info.option).second);
    for (int i = 0; i < 4; ++i) {
      const auto name = info.channels[static_cast<std::size_t>(i)];
      EXPECT_EQ(name.empty(), i >= info.channel_count) << info.option;
      if (!name.empty()) {
        EXPECT_TRUE(channels.insert(name).second) << name;
      }
    }
  }
  EXPECT_EQ(index, kernels::kAovCount);
  EXPECT_EQ(channels.size(), 28u);
}

TEST(Aovs, ParsesNamesAliasesAndAll) {
  const auto set = parse_aovs("Z, mask,Ng,beauty");
  ASSERT_TRUE(set);
  EXPECT_EQ(set->count(), 4u);
  EXPECT_TRUE(set->test(static_cast<std::size_t>(Aov::depth)));
  EXPECT_TRUE(set->test(static_cast<std::size_t>(Aov::geometric_normal)));
  EXPECT_EQ(*parse_aovs("depth,DEPTH,z"), *parse_aovs("Z"));
  EXPECT_TRUE(parse_aovs("all")->all());
}

TEST(Aovs, UnknownNameIsAUsageErrorThatListsWhatExists) {
  for (const char* bad : {"", "colour", "Z,", ",Z", "Z,,mask", "beauty,nope"}) {
    const auto set = parse_aovs(bad);
    ASSERT_FALSE(set) << bad;
    EXPECT_EQ(set.error().exit, util::Exit::usage);
    for (const AovInfo& info : aov_table())
      EXPECT_NE(set.error().message.find(info.option), std::string::npos);
  }
}

TEST(Aovs, FramebufferHoldsOnlyWhatWasAskedFor) {
  Framebuffer framebuffer(7, 5, *parse_aovs("normal,object_id"));
  EXPECT_EQ(framebuffer.floats(Aov::normal).size(), 7u * 5 * 3);
  EXPECT_EQ(framebuffer.uints(Aov::object_id).size(), 35u);
  EXPECT_TRUE(framebuffer.floats(Aov::depth).empty());
  EXPECT_TRUE(framebuffer.floats(Aov::object_id).empty());
  EXPECT_EQ(framebuffer.view().floats(Aov::beauty), nullptr);
}

}  // namespace
}  // namespace octrace::render
