// That paths differ is proved from patterns; here every proof is held against the paths themselves.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "backend/batch/distinct_paths.h"
#include "tests/support/intensity.h"

namespace octrace::test {
namespace {

using batch::OutputPattern;
using batch::PathSpace;

struct World {
  std::vector<std::string> scenes;
  std::vector<std::vector<std::string>> cameras;  // by scene, or one for all
  std::vector<std::int64_t> frames;
  std::vector<std::string> aovs;

  std::vector<batch::CameraList> lists;
  std::vector<std::uint32_t> list_of;

  PathSpace space() {
    lists.clear();
    list_of.clear();
    for (const auto& names : cameras) {
      lists.emplace_back().add(0, names);
      if (cameras.size() > 1) list_of.push_back(static_cast<std::uint32_t>(list_of.size()));
    }
    PathSpace space{scenes, lists, list_of, frames, 0};
    const std::uint64_t count = std::max<std::size_t>(1, frames.size());
    for (std::size_t s = 0; s < scenes.size(); ++s)
      space.views += count * space.cameras_in(s).size();
    return space;
  }
};

std::vector<std::string> all_paths(const OutputPattern& pattern, World& world) {
  std::vector<std::string> paths;
  const PathSpace space = world.space();
  batch::PathFields fields;
  for (std::size_t s = 0; s < world.scenes.size(); ++s) {
    for (std::size_t f = 0; f < std::max<std::size_t>(1, world.frames.size()); ++f) {
      for (std::size_t c = 0; c < space.cameras_in(s).size(); ++c) {
        fields.scene = world.scenes[s];
        fields.camera = space.cameras_in(s).path_name(c);
        fields.frame = world.frames.empty() ? 0 : world.frames[f];
        fields.scene_index = s;
        fields.camera_index = c;
        for (std::size_t a = 0; a < std::max<std::size_t>(1, world.aovs.size()); ++a) {
          if (!world.aovs.empty()) fields.aov = world.aovs[a];
          paths.push_back(pattern.path(fields));
        }
        ++fields.view;
      }
    }
  }
  return paths;
}

bool truly_distinct(const std::vector<std::string>& paths) {
  return std::set<std::string>(paths.begin(), paths.end()).size() == paths.size();
}

OutputPattern parse(const std::string& text) {
  auto pattern = OutputPattern::parse(text);
  EXPECT_TRUE(pattern) << text;
  return std::move(*pattern);
}

TEST(DistinctPaths, UsualPatternsNeedNoComparing) {
  World world;
  world.scenes = {"a", "bc", "a_b"};
  world.cameras = {{"turntable_000", "turntable_001"}};
  for (std::int64_t frame = 0; frame < 120; ++frame) world.frames.push_back(frame);
  const auto proved = [&](const char* text) {
    return batch::surely_distinct(parse(text), world.aovs, world.space());
  };
  EXPECT_TRUE(proved("out/{scene}_{camera}_{frame:04}.exr"));
  EXPECT_TRUE(proved("out/{scene}/{camera}_{frame:04}.exr"));
  EXPECT_TRUE(proved("out/{scene}/{camera}/{frame}.exr"));
  EXPECT_TRUE(proved("{view}.npz"));
  EXPECT_TRUE(proved("out/{view/1000:06}/{view:09}.npz"));
  EXPECT_TRUE(proved("out/{scene_index/1000}/{scene_index}_{camera_index}_{frame}.exr"));
  EXPECT_FALSE(proved("out/{view/2}.npz"));
  EXPECT_FALSE(proved("out/{scene}_{camera}.exr"));
  EXPECT_TRUE(proved("out/{view}_{frame}.exr"));
  EXPECT_FALSE(proved("out/{view}{frame}.exr"));
  world.aovs = {"Z", "mask"};
  EXPECT_TRUE(proved("out/{scene}/{camera}_{frame:04}_{aov}.npy"));
  EXPECT_FALSE(proved("out/{scene}/{camera}_{frame:04}.npy"));
  // Where it is not clear which name ends where, pairs are compared: here two are the same.
  world.aovs = {};
  world.cameras = {{"c", "b_c"}};
  EXPECT_FALSE(proved("out/{scene}_{camera}_{frame:04}.exr"));
  EXPECT_TRUE(proved("out/{scene}+{camera_index}_{camera}_{frame:04}.exr"));
}

TEST(DistinctPaths, NoProofIsWrong) {
  std::mt19937 random(static_cast<unsigned>(tests::seed()));
  const auto any = [&](int below) {
    return static_cast<int>(std::uniform_int_distribution<int>(0, below - 1)(random));
  };
  const std::vector<std::string> fields = {
      "{scene}",    "{camera}",     "{frame}",       "{scene}",           "{camera}",
      "{frame:02}", "{view}",       "{scene_index}", "{camera_index:01}", "{view/3}",
      "{aov}",      "{frame/2:02}", "{view:02}"};
  const std::vector<std::string> between = {"_", "/", "", "_", "1", "a", "-", " ", "x/"};
  const std::vector<std::string> names = {"a", "a_a", "11"};
  int proved = 0, refused = 0;
  for (std::uint64_t round = 0; round < tests::scaled(100000); ++round) {
    std::string text = between[any(9)];
    for (int i = 1 + any(4); i > 0; --i) text += fields[any(13)] + between[any(9)];
    const OutputPattern pattern = parse(text + ".npy");
    World world;
    const auto some = [&](int most) {
      std::vector<std::string> list;
      for (int i = 1 + any(most); i > 0; --i) list.push_back(names[any(3)]);
      return list;
    };
    world.scenes = some(3);
    world.cameras.push_back(some(3));
    if (any(2) == 0) {
      while (world.cameras.size() < world.scenes.size()) world.cameras.push_back(some(3));
    }
    std::set<std::int64_t> frames;
    for (int i = any(4); i > 0; --i) frames.insert(any(3) == 0 ? 8 + any(8) : any(100));
    world.frames.assign(frames.begin(), frames.end());
    if (pattern.has_aov()) world.aovs = {"Z", "mask"};
    const bool claimed = batch::surely_distinct(pattern, world.aovs, world.space());
    ++(claimed ? proved : refused);
    if (claimed) {
      EXPECT_TRUE(truly_distinct(all_paths(pattern, world))) << text << ", round " << round;
    }
  }
  EXPECT_GT(proved, refused / 20);  // the test is about something
}

TEST(CameraList, CountedNames) {
  batch::CameraList list;
  list.add(0, {"x", "y"});
  list.add_numbered(3, "ring", 1000000);
  list.add_numbered(4, "b", 2);
  EXPECT_EQ(list.size(), 1000004u);
  EXPECT_EQ(list.name(1), "y");
  EXPECT_EQ(list.name(2), "ring_000000");
  EXPECT_EQ(list.name(1000001), "ring_999999");
  EXPECT_EQ(list.name(1000003), "b_001");
  EXPECT_EQ(list.at(1000001).entry, 3u);
  EXPECT_EQ(list.at(1000001).index, 999999u);
  EXPECT_EQ(list.at(1000003).index, 1u);
  EXPECT_TRUE(list.paths_surely_differ());
  EXPECT_FALSE(list.path_length());
  const auto differ = [](std::vector<std::string> names, std::vector<std::string> counted) {
    batch::CameraList some;
    some.add(0, std::move(names));
    for (const std::string& name : counted) some.add_numbered(0, name, 20);
    return some.paths_surely_differ();
  };
  EXPECT_FALSE(differ({"x", "x"}, {}));
  EXPECT_FALSE(differ({"a b", "a:b"}, {}));  // both are a_b in a path
  EXPECT_FALSE(differ({"ring_007"}, {"ring"}));
  EXPECT_FALSE(differ({}, {"ring", "ring"}));
  EXPECT_FALSE(differ({}, {"r", "r_0"}));
  EXPECT_TRUE(differ({"ring"}, {"ring", "rin"}));
  EXPECT_FALSE(differ({}, {std::string(97, 'n')}));  // the number is cut off
  EXPECT_TRUE(differ({}, {std::string(96, 'n')}));
  batch::CameraList even;
  even.add_numbered(0, "ring", 50);
  even.add(1, {"ring_abc"});
  EXPECT_EQ(even.path_length(), 8u);
}

TEST(DistinctPaths, Apart) {
  const auto apart = [](const char* a, const char* b) {
    return batch::surely_apart("", parse(a), "", parse(b));
  };
  EXPECT_TRUE(apart("out/{view}.exr", "out/{view}.npz"));
  EXPECT_TRUE(apart("a/{view}.exr", "b/{view}.exr"));
  EXPECT_TRUE(apart("out/{view}_Z.npy", "out/{view}_mask.npy"));
  EXPECT_FALSE(apart("out/{view}.exr", "out/{scene}.exr"));
  EXPECT_FALSE(apart("out/{view}.exr", "out/{view}_Z.exr"));
  EXPECT_FALSE(apart("{scene}/{view}.exr", "out/{view}.exr"));
}

}  // namespace
}  // namespace octrace::test
