#include "validation/compare/geometry.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/validation/synthetic.h"

namespace octrace::validation::test {
namespace {

GeometryMetrics metrics_of(const Planes& a, const Planes& b) {
  auto metrics = compare_geometry(a, b, kPovrayTolerances);
  EXPECT_TRUE(metrics) << (metrics ? "" : metrics.error().to_string());
  return metrics ? *metrics : GeometryMetrics{};
}

bool passes(const GeometryMetrics& metrics, const Tolerances& tolerances) {
  const auto checks = judge(metrics, tolerances);
  return std::all_of(checks.begin(), checks.end(), [](const Check& c) { return c.passed(); });
}

const Check& check_named(const std::vector<Check>& checks, const std::string& name) {
  return *std::find_if(checks.begin(), checks.end(),
                       [&](const Check& check) { return check.name == name; });
}

TEST(Geometry, EqualImagesHaveNoError) {
  const GeometryMetrics m = metrics_of(disc(), disc());
  EXPECT_EQ(m.mask_total, 0u);
  EXPECT_EQ(m.iou, 1.0);
  EXPECT_EQ(m.depth_max, 0.0);
  EXPECT_EQ(m.outliers, 0u);
  EXPECT_TRUE(m.worst.empty());
  EXPECT_GT(m.interior, 4000u);
  EXPECT_LT(m.interior, m.covered_both);
  EXPECT_TRUE(passes(m, kPovrayTolerances));
}

TEST(Geometry, ConstantRelativeErrorIsFoundExactly) {
  Planes a = disc();
  const Planes b = disc();
  for (float& z : a.z) z *= 1.0f + 1.0f / 1024;
  const GeometryMetrics m = metrics_of(a, b);
  EXPECT_NEAR(m.depth_median, 1.0 / 1024, 1e-7);
  EXPECT_NEAR(m.depth_p99, 1.0 / 1024, 1e-7);
  EXPECT_NEAR(m.depth_max, 1.0 / 1024, 1e-7);
  EXPECT_EQ(m.outliers, 0u);  // 1/1024 is below 1e-3
  EXPECT_FALSE(passes(m, kBlenderTolerances));
}

TEST(Geometry, PercentilesAreOfNearestRank) {
  Planes a = disc();
  const Planes b = disc();
  const std::uint64_t interior = metrics_of(a, b).interior;
  // Doubles the depth of exactly 1 % (rounded down) of the interior, then of one pixel more.
  const std::uint64_t few = interior / 100;
  std::uint64_t done = 0;
  for (std::uint32_t y = 50; y < 70 && done < few; ++y) {
    for (std::uint32_t x = 60; x < 100 && done < few; ++x, ++done) a.z[at(x, y)] *= 2.0f;
  }
  const GeometryMetrics within = metrics_of(a, b);
  EXPECT_EQ(within.depth_p99, 0.0);
  EXPECT_EQ(within.depth_max, 1.0);
  EXPECT_EQ(within.outliers, few);
  a.z[at(80, 75)] *= 2.0f;
  EXPECT_EQ(metrics_of(a, b).depth_p99, 1.0);
}

TEST(Geometry, ShiftedSilhouetteDiffersNearItsEdge) {
  const auto depth = [](double, double) { return 5.0; };
  const GeometryMetrics m = metrics_of(disc(80.4, 60, 40, depth), disc(80, 60, 40, depth));
  EXPECT_GT(m.mask_total, 20u);
  EXPECT_EQ(m.mask_far, 0u);
  EXPECT_LT(m.iou, 1.0);
  EXPECT_FALSE(passes(m, kPovrayTolerances));
}

TEST(Geometry, IouIsIntersectionOverUnion) {
  Planes a = disc(), b = disc();
  const auto covered = static_cast<double>(std::count(a.mask.begin(), a.mask.end(), 1));
  for (std::uint32_t x = 70; x < 80; ++x) erase(a, x, 60);
  for (std::uint32_t x = 90; x < 95; ++x) erase(b, x, 60);
  const GeometryMetrics m = metrics_of(a, b);
  EXPECT_EQ(m.mask_total, 15u);
  EXPECT_DOUBLE_EQ(m.iou, (covered - 15) / covered);
}

TEST(Geometry, HoleIsFarFromEveryEdge) {
  Planes a = disc();
  erase(a, 80, 60);
  GeometryMetrics m = metrics_of(a, disc());
  EXPECT_EQ(m.mask_total, 1u);
  EXPECT_EQ(m.mask_far, 1u);
  ASSERT_EQ(m.worst.size(), 1u);
  EXPECT_EQ(m.worst[0].kind, DisagreementKind::mask);
  EXPECT_EQ(m.worst[0].x, 80u);
  EXPECT_EQ(m.worst[0].y, 60u);
  EXPECT_FALSE(passes(m, kBlenderTolerances));
  EXPECT_TRUE(metrics_of(a, disc()).mask_far <= kPovrayTolerances.mask_far);
}

TEST(Geometry, DepthJumpsAreNoInterior) {
  // Two planes that meet at x = 80, a metre apart: sampling either is right within a pixel of it.
  const auto step = [](double x, double) { return x < 80 ? 5.0 : 6.0; };
  const auto later = [](double x, double) { return x < 81 ? 5.0 : 6.0; };
  const GeometryMetrics m = metrics_of(disc(80, 60, 40, later), disc(80, 60, 40, step));
  EXPECT_EQ(m.depth_max, 0.0);
  EXPECT_GT(m.outliers, 70u);  // and yet a whole column of them is no accident
  EXPECT_FALSE(passes(m, kPovrayTolerances));
}

TEST(Geometry, WorstDisagreementComesFirst) {
  Planes a = disc();
  a.z[at(70, 50)] *= 1.1f;
  a.z[at(75, 55)] *= 1.3f;
  a.z[at(90, 65)] *= 1.2f;
  const GeometryMetrics m = metrics_of(a, disc());
  ASSERT_EQ(m.worst.size(), 3u);
  EXPECT_EQ(m.worst[0].x, 75u);
  EXPECT_EQ(m.worst[0].y, 55u);
  EXPECT_NEAR(m.worst[0].error, 0.3, 1e-6);
  EXPECT_NEAR(m.worst[2].error, 0.1, 1e-6);
}

TEST(Geometry, InfiniteDepthOnACoveredPixelIsAnOutlier) {
  Planes a = disc();
  a.z[at(80, 60)] = std::numeric_limits<float>::infinity();
  const GeometryMetrics m = metrics_of(a, disc());
  EXPECT_EQ(m.outliers, 1u);
  EXPECT_TRUE(std::isinf(m.depth_max));
}

TEST(Geometry, HistogramHoldsTheInterior) {
  Planes a = disc();
  for (float& z : a.z) z *= 1.001f;
  const GeometryMetrics m = metrics_of(a, disc());
  std::uint64_t sum = 0;
  for (const auto count : m.histogram) sum += count;
  EXPECT_EQ(sum, m.interior);
  std::uint64_t around = 0;  // 1e-3 to rounding: the bin that starts there, or the one below
  for (int i = -1; i <= 0; ++i) around += m.histogram[(-3 - kHistogramLow) * kBinsPerDecade + i];
  EXPECT_EQ(around, m.interior);
}

TEST(Geometry, ObjectIdsAreComparedOnTheInterior) {
  Planes a = disc(), b = disc();
  for (Planes* planes : {&a, &b}) {
    planes->object_id.resize(planes->mask.size());
    for (std::size_t i = 0; i < planes->mask.size(); ++i)
      planes->object_id[i] = 3 * planes->mask[i];
  }
  EXPECT_EQ(metrics_of(a, b).ids_differ, 0u);
  for (std::uint32_t x = 60; x < 100; ++x) a.object_id[at(x, 60)] = 4;
  const GeometryMetrics m = metrics_of(a, b);
  EXPECT_EQ(m.ids_differ, 40u);
  EXPECT_FALSE(check_named(judge(m, kPovrayTolerances), "id-share").passed());
}

TEST(Geometry, EmptyImagesAgree) {
  const auto depth = [](double, double) { return 1.0; };
  const GeometryMetrics m = metrics_of(disc(80, 60, 0, depth), disc(80, 60, 0, depth));
  EXPECT_EQ(m.covered_both, 0u);
  EXPECT_EQ(m.iou, 1.0);
}

TEST(Geometry, OneEmptyImageDiffers) {
  const auto depth = [](double, double) { return 1.0; };
  const GeometryMetrics m = metrics_of(disc(80, 60, 0, depth), disc());
  EXPECT_EQ(m.iou, 0.0);
  EXPECT_FALSE(passes(m, kPovrayTolerances));
}

TEST(Geometry, SizesMustBeEqual) {
  Planes a = disc();
  a.width = kHeight;
  a.height = kWidth;
  auto metrics = compare_geometry(a, disc(), kPovrayTolerances);
  ASSERT_FALSE(metrics);
  EXPECT_EQ(metrics.error().exit, util::Exit::invalid_input);
  EXPECT_NE(metrics.error().message.find("120x160"), std::string::npos);
}

TEST(Geometry, MasksAloneCanBeCompared) {
  Planes a = disc(), b = disc();
  a.z.clear();
  const GeometryMetrics m = metrics_of(a, b);
  EXPECT_FALSE(m.has_depth);
  EXPECT_EQ(judge(m, kPovrayTolerances).size(), 3u);
}

TEST(Tolerances, EachNameCanBeSet) {
  for (const ToleranceField& field : kToleranceFields) {
    Tolerances tolerances = kDefaultTolerances;
    ASSERT_TRUE(override_tolerance(tolerances, std::string(field.name) + "=0.25"));
    EXPECT_EQ(tolerances.*field.value, 0.25) << field.name;
  }
}

TEST(Tolerances, BadAssignmentsAreUsageErrors) {
  for (const char* text :
       {"", "iou", "iou=", "iou=x", "iou=1e", "iou=-1", "iou=nan", "iuo=1", "=1"}) {
    Tolerances tolerances = kDefaultTolerances;
    const auto result = override_tolerance(tolerances, text);
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().exit, util::Exit::usage);
  }
}

}  // namespace
}  // namespace octrace::validation::test
