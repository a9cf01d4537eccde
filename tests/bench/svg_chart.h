// Line charts as SVG, with nothing but text: axes with round ticks, linear or logarithmic, a
// legend.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace octrace::bench {

struct ChartSeries {
  std::string label;
  std::string color;  // "#0072b2"
  std::vector<std::pair<double, double>> points;
  bool dashed = false;
  bool marks = true;
};

struct Chart {
  std::string title, x_label, y_label;
  std::vector<double> x_ticks;  // the axis runs from the first to the last, also downwards
  bool log_y = false;
  std::vector<ChartSeries> series;  // those without points stand in the legend as "not measured"
  bool log_x = false;               // ticks then read as 131k, 2.1M
};

// Charts side by side, a title above, lines of notes below.
std::string svg_page(const std::string& title, const std::vector<Chart>& charts,
                     const std::vector<std::string>& notes);

}  // namespace octrace::bench
