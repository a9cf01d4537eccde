#include "validation/report/report.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "backend/image/image.h"
#include "backend/util/atomic_file.h"
#include "tests/validation/synthetic.h"
#include "validation/reference/scratch.h"
#include "validation/report/html.h"

namespace octrace::validation::test {
namespace {

Report sample_report() {
  Report report;
  report.title = "Two <views>";
  report.facts = {{"command", "octrace validate \"a&b.glb\""}};
  report.tolerances = {{"POV-Ray", kPovrayTolerances}, {"Blender", kBlenderTolerances}};
  Comparison good;
  good.scene = "a&b.glb";
  good.camera = "front";
  good.first = "octrace";
  good.second = "POV-Ray";
  EXPECT_TRUE(fill_comparison(good, disc(), disc(), {.tolerances = kPovrayTolerances}));
  Comparison bad = good;
  bad.second = "Blender";
  Planes hole = disc();
  erase(hole, 80, 60);
  EXPECT_TRUE(fill_comparison(bad, hole, disc(), {.tolerances = kBlenderTolerances}));
  Comparison failed = good;
  failed.status = Status::error;
  failed.cause = "POV-Ray (/usr/bin/povray) failed with exit code 1";
  failed.geometry.reset();
  failed.checks.clear();
  failed.pictures = {};
  report.comparisons = {good, bad, failed};
  return report;
}

TEST(Report, StatusFollowsTheChecks) {
  const Report report = sample_report();
  EXPECT_EQ(report.comparisons[0].status, Status::agree);
  EXPECT_EQ(report.comparisons[1].status, Status::differ);
  const Totals sum = totals(report);
  EXPECT_EQ(sum.comparisons, 3u);
  EXPECT_EQ(sum.agree, 1u);
  EXPECT_EQ(sum.differ, 1u);
  EXPECT_EQ(sum.errors, 1u);
}

TEST(Report, LineSaysWhatIsBeyondTolerance) {
  const std::string line = one_line(sample_report().comparisons[1]);
  EXPECT_TRUE(line.starts_with("differ ")) << line;
  EXPECT_NE(line.find("mask-far 1 > 0"), std::string::npos) << line;
}

TEST(Report, PageIsSelfContainedAndEscaped) {
  const std::string page = report_html(sample_report());
  EXPECT_EQ(page.find("http"), std::string::npos);
  EXPECT_EQ(page.find("<views>"), std::string::npos);
  EXPECT_NE(page.find("Two &lt;views&gt;"), std::string::npos);
  EXPECT_NE(page.find("a&amp;b.glb"), std::string::npos);
  // Two comparisons with two silhouettes, a difference, two depths and an error map each.
  std::size_t pictures = 0;
  for (auto i = page.find("data:image/png"); i != std::string::npos;
       i = page.find("data:image/png", i + 1)) {
    ++pictures;
  }
  EXPECT_EQ(pictures, 12u);
}

TEST(Report, JsonHasTheSameFigures) {
  const auto json = nlohmann::json::parse(report_json(sample_report()));
  EXPECT_EQ(json["totals"]["differ"], 1);
  EXPECT_EQ(json["tolerances"]["Blender"]["depth-p99"], 1e-5);
  const auto& bad = json["comparisons"][1];
  EXPECT_EQ(bad["status"], "differ");
  EXPECT_EQ(bad["geometry"]["mask_far"], 1);
  EXPECT_EQ(bad["geometry"]["largest_disagreements"][0]["pixel"], nlohmann::json({80, 60}));
  EXPECT_EQ(json["comparisons"][2]["cause"], "POV-Ray (/usr/bin/povray) failed with exit code 1");
}

TEST(Report, NamesThatAreNotUtf8DoNotBreakIt) {
  Report report = sample_report();
  report.comparisons[0].scene = "caf\xe9.glb";
  EXPECT_TRUE(nlohmann::json::accept(report_json(report)));
}

TEST(Report, NothingInCommonIsAnError) {
  Planes beauty_only;
  beauty_only.width = kWidth;
  beauty_only.height = kHeight;
  beauty_only.rgb.resize(3 * kWidth * kHeight);
  Comparison comparison;
  const auto filled = fill_comparison(comparison, beauty_only, disc(), {});
  ASSERT_FALSE(filled);
  EXPECT_EQ(filled.error().exit, util::Exit::invalid_input);
}

TEST(Report, FilesAreWritten) {
  auto scratch = Scratch::create("octrace-test");
  ASSERT_TRUE(scratch);
  const std::string folder = scratch->file("deep/report");
  ASSERT_TRUE(write_report(sample_report(), folder));
  EXPECT_TRUE(std::ifstream(folder + "/index.html").good());
  EXPECT_TRUE(std::ifstream(folder + "/report.json").good());
}

TEST(Png, PalettesReadBackByTheImageLibrary) {
  auto scratch = Scratch::create("octrace-test");
  ASSERT_TRUE(scratch);
  for (const int colors : {2, 4, 16, 256}) {
    std::vector<Rgb> palette;
    for (int i = 0; i < colors; ++i) {
      palette.push_back({std::uint8_t(i * 255 / (colors - 1)), std::uint8_t(255 - i), 7});
    }
    const std::uint32_t width = 13, height = 9;  // no multiple of what a byte holds
    std::vector<std::uint8_t> indices;
    for (std::uint32_t i = 0; i < width * height; ++i) {
      indices.push_back(std::uint8_t(i * 31 % std::uint32_t(colors)));
    }
    const std::string path = scratch->file("p.png");
    ASSERT_TRUE(util::write_file(path, encode_palette_png(width, height, indices, palette)));
    const auto image = image::read(path, {});
    ASSERT_TRUE(image) << (image ? "" : image.error().to_string());
    ASSERT_EQ(image->width, width);
    ASSERT_EQ(image->height, height);
    ASSERT_GE(image->planes.size(), 3u);
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < indices.size(); ++i) {
        ASSERT_NEAR(image->planes[c].floats[i] * 255.0, palette[indices[i]][c], 0.01)
            << colors << " colours, channel " << c << ", pixel " << i;
      }
    }
  }
}

TEST(Png, TrueColourReadsBack) {
  auto scratch = Scratch::create("octrace-test");
  ASSERT_TRUE(scratch);
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < 5 * 4 * 3; ++i) samples.push_back(std::uint8_t(i * 37));
  const std::string path = scratch->file("p.png");
  ASSERT_TRUE(util::write_file(path, encode_rgb_png(5, 4, samples)));
  const auto image = image::read(path, {});
  ASSERT_TRUE(image);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_NEAR(image->planes[i % 3].floats[i / 3] * 255.0, samples[i], 0.01);
  }
}

TEST(Png, Base64) {  // RFC 4648, section 10
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xff\xfe"), "//4=");
}

TEST(Colors, ScalesRunFromDarkToBright) {
  for (const auto color : {depth_color, error_color}) {
    double last = -1.0;
    for (int i = 0; i <= 20; ++i) {
      const Rgb rgb = color(i / 20.0);
      const double luma = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
      EXPECT_GT(luma, last - 0.5) << i;
      last = luma;
    }
  }
}

}  // namespace
}  // namespace octrace::validation::test
