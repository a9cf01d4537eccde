// Growth over sizes, worked by hand.
#include "tests/bench/growth.h"

#include <gtest/gtest.h>

namespace octrace::bench {
namespace {

using nlohmann::json;

json ray_row(double triangles, double mrays, double nodes) {
  return {{"set", "bounce"},
          {"quads", 1},
          {"triangles", triangles},
          {"mrays_per_s", mrays},
          {"nodes_per_ray", nodes},
          {"triangles_per_ray", nodes / 2},
          {"peer_mrays_per_s", 2 * mrays}};
}

TEST(Growth, IsTheTimeARayOverTheLogarithmOfTheSize) {
  // 2^10, 2^20 and 2^30 triangles, the largest first: 100, 200 and 450 ns a ray.
  json rows = {ray_row(1073741824.0, 1e3 / 450.0, 30.0),
               ray_row(1024.0, 10.0, 10.0),
               ray_row(1048576.0, 5.0, 24.0),
               {{"builder", "octrace sah"}, {"quads", 1}, {"triangles", 1024.0}, {"ms", 2.0}}};
  add_growth(rows);
  ASSERT_EQ(4u, rows.size());
  EXPECT_EQ(1024.0, rows[0]["triangles"]);
  EXPECT_NEAR(10.0, rows[0]["time_per_log"], 1e-9);
  EXPECT_FALSE(rows[0].contains("time_per_log_step"));
  EXPECT_FALSE(rows[1].contains("time_per_log"));  // the build
  EXPECT_NEAR(1.0, rows[2]["time_per_log_step"], 1e-9);
  EXPECT_NEAR(1.2, rows[2]["work_per_log_step"], 1e-9);
  EXPECT_NEAR(1.5, rows[3]["time_per_log_step"], 1e-9);
  EXPECT_NEAR(10.0 / 12.0, rows[3]["work_per_log_step"], 1e-9);

  const std::string report = growth_report(rows);
  EXPECT_NE(std::string::npos, report.find("in all: time / log2 1.50 x, nodes and triangles / log2 "
                                           "1.00 x; Embree's time / log2 1.50 x"))
      << report;
}

TEST(Growth, DrawsWhatWasMeasuredAndSaysWhatWasNot) {
  json rows = {ray_row(131072.0, 4.0, 10.0), ray_row(2097152.0, 3.0, 12.0)};
  for (json& row : rows) row["set"] = "primary";
  add_growth(rows);
  const std::string svg = growth_svg(rows, "one thread");
  EXPECT_NE(std::string::npos, svg.find(">131k</text>"));
  EXPECT_NE(std::string::npos, svg.find(">2.1M</text>"));
  EXPECT_NE(std::string::npos, svg.find("octrace, primary</text>"));
  EXPECT_NE(std::string::npos, svg.find("octrace, ao (not measured)"));
  EXPECT_NE(std::string::npos, svg.find("octrace sah (not measured)"));
}

}  // namespace
}  // namespace octrace::bench
