// Objects of a view, and their masks as COCO's run lengths.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <random>

#include "backend/batch/run_length.h"
#include "backend/batch/view_objects.h"

namespace octrace::batch {
namespace {

using Ids = std::vector<std::uint32_t>;

Ids make_ids(int width, int height, const std::function<std::uint32_t(int x, int y)>& id) {
  Ids ids;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) ids.push_back(id(x, y));
  }
  return ids;
}

// Rows from the top, out of the compressed text, after the description of COCO's format and not
// after the product's code: a character holds five bits from '0' on and whether more follow.
std::vector<bool> decode(const std::string& text, int width, int height) {
  std::vector<long> counts;
  std::vector<int> digits;
  for (const char c : text) {
    digits.push_back((c - '0') % 32);
    if (c - '0' >= 32) continue;
    double value = digits.back() >= 16 ? digits.back() - 32 : digits.back();
    digits.pop_back();
    for (; !digits.empty(); digits.pop_back()) value = value * 32 + digits.back();
    if (counts.size() >= 3) value += static_cast<double>(counts[counts.size() - 2]);
    counts.push_back(static_cast<long>(value));
  }
  std::vector<bool> columns;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    EXPECT_GE(counts[i], 0);
    columns.insert(columns.end(), static_cast<std::size_t>(counts[i]), i % 2 == 1);
  }
  EXPECT_EQ(columns.size(), static_cast<std::size_t>(width) * height) << text;
  columns.resize(static_cast<std::size_t>(width) * height);
  std::vector<bool> rows;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      rows.push_back(columns[static_cast<std::size_t>(x * height + y)]);
  }
  return rows;
}

// Strings made by rleEncode and rleToString of cocodataset/cocoapi (28dffd9).
TEST(ViewObjects, MasksAreTheStringsOfCocosOwnProgram) {
  struct Case {
    int width, height;
    std::function<bool(int x, int y)> inside;
    const char* text;
  };
  for (const Case& c :
       {Case{4, 3, [](int, int) { return true; }, "0<"},
        Case{4, 3, [](int x, int y) { return x == 0 && y == 0; }, "01;"},
        Case{4, 3, [](int x, int y) { return x == 3 && y == 2; }, ";1"},
        Case{5, 4, [](int x, int) { return x == 2; }, "848"},
        Case{6, 5, [](int x, int y) { return (x + y) % 2 == 1; }, "111000000000000000000000000000"},
        Case{640, 480,
             [](int x, int y) { return (x - 320) * (x - 320) + (y - 240) * (y - 240) < 144; },
             "\\Ra49e>4M2N2N2N2O0O2O0000000000000001N101N2N2N2N3LfT`4"},
        Case{1000, 1000, [](int x, int y) { return (x == 0 && y == 0) || (x == 999 && y >= 500); },
             "01[R`n0c?"}}) {
    const Ids ids =
        make_ids(c.width, c.height, [&](int x, int y) { return c.inside(x, y) ? 7u : 0u; });
    const auto objects = find_objects(ids, c.width, c.height, true);
    ASSERT_EQ(objects.size(), 1u);
    EXPECT_EQ(objects[0].id, 7u);
    EXPECT_EQ(objects[0].rle, c.text);
  }
  EXPECT_TRUE(find_objects(Ids(12, 0), 4, 3, true).empty());
}

void check_against_pixels(const Ids& ids, int width, int height) {
  struct Seen {
    std::uint64_t pixels = 0;
    int left = 1 << 30, top = 1 << 30, right = -1, bottom = -1;
  };
  std::map<std::uint32_t, Seen> seen;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint32_t id = ids[static_cast<std::size_t>(y * width + x)];
      if (id == 0) continue;
      Seen& s = seen[id];
      ++s.pixels;
      s.left = std::min(s.left, x);
      s.right = std::max(s.right, x);
      s.top = std::min(s.top, y);
      s.bottom = std::max(s.bottom, y);
    }
  }
  const auto objects = find_objects(ids, width, height, true);
  ASSERT_EQ(objects.size(), seen.size());
  auto expected = seen.begin();
  for (const ViewObject& object : objects) {
    ASSERT_EQ(object.id, expected->first);
    const Seen& s = expected->second;
    EXPECT_EQ(object.pixels, s.pixels);
    EXPECT_EQ(std::tuple(object.left, object.top, object.right, object.bottom),
              std::tuple(s.left, s.top, s.right, s.bottom));
    const std::vector<bool> mask = decode(object.rle, width, height);
    for (std::size_t i = 0; i < mask.size(); ++i) ASSERT_EQ(mask[i], ids[i] == object.id) << i;
    const auto counts = expand_counts(object.rle, ids.size());
    ASSERT_TRUE(counts) << counts.error().to_string();
    std::uint64_t inside = 0;
    for (std::size_t i = 1; i < counts->size(); i += 2) inside += (*counts)[i];
    EXPECT_EQ(inside, object.pixels);
    EXPECT_EQ(compress_counts(*counts), object.rle);
    ++expected;
  }
}

TEST(ViewObjects, BoxesCountsAndMasksAreThoseOfThePixels) {
  std::mt19937 random(5);
  for (const auto& [width, height] :
       {std::pair(1, 1), {1, 9}, {9, 1}, {16, 16}, {17, 33}, {40, 31}, {70, 64}}) {
    for (const std::uint32_t ids : {1u, 2u, 5u, 300u}) {
      check_against_pixels(make_ids(width, height, [&](int, int) { return random() % (ids + 1); }),
                           width, height);
    }
    check_against_pixels(make_ids(width, height, [](int, int) { return 0xffffffffu; }), width,
                         height);
    check_against_pixels(
        make_ids(width, height, [](int x, int y) { return (x / 7 + y / 5 * 3) % 4 * 1000u; }),
        width, height);
  }
}

TEST(RunLength, LongRunsAndDifferencesSurvive) {
  std::mt19937_64 random(6);
  for (int i = 0; i < 200; ++i) {
    std::vector<std::uint64_t> counts;
    std::uint64_t sum = 0;
    for (int k = 0; k < 20; ++k) {
      counts.push_back(random() >> (24 + random() % 40));
      sum += counts.back();
    }
    const auto back = expand_counts(compress_counts(counts), sum);
    ASSERT_TRUE(back) << back.error().to_string();
    EXPECT_EQ(*back, counts);
  }
}

TEST(RunLength, WhatIsNoMaskIsAnError) {
  for (const char* text : {"", "1", "0=", "0;", "01:", "P", "PPPPPPPPPPPPPPPPPP0", "/", "p", "~",
                           " ", "O<", "0<O", "\xff"}) {
    const auto counts = expand_counts(text, 12);
    ASSERT_FALSE(counts) << text;
    EXPECT_EQ(counts.error().exit, util::Exit::invalid_input);
  }
  EXPECT_TRUE(expand_counts("0<", 12));
  EXPECT_TRUE(expand_counts("<0", 12));
}

}  // namespace
}  // namespace octrace::batch
