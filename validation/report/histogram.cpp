#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "validation/report/html.h"

namespace octrace::validation {
namespace {

constexpr double kWidth = 460, kHeight = 170, kLeft = 8, kRight = 8, kTop = 26, kBottom = 30;
constexpr double kPlotWidth = kWidth - kLeft - kRight, kPlotHeight = kHeight - kTop - kBottom;

double position(double error) {
  const double decade = error > 0.0 ? std::log10(error) : kHistogramLow;
  return kLeft +
         kPlotWidth *
             std::clamp((decade - kHistogramLow) / (kHistogramHigh - kHistogramLow), 0.0, 1.0);
}

std::string limit_line(const Check& check, const char* label, double label_y) {
  return fmt::format(R"(<line class="limit" x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}"/>)"
                     R"(<text class="limit-text" x="{3:.1f}" y="{4}">{5} &le; {6}</text>)",
                     position(check.limit), kTop - 4, kHeight - kBottom, position(check.limit) + 4,
                     label_y, label, format_error(check.limit));
}

}  // namespace

std::string histogram_svg(const GeometryMetrics& metrics, const std::vector<Check>& checks) {
  const auto largest = *std::max_element(metrics.histogram.begin(), metrics.histogram.end());
  // Bars grow with the logarithm of their count: a single pixel must stay visible beside 10^5.
  const double scale = kPlotHeight / std::log1p(std::max<double>(1.0, double(largest)));
  std::string svg = fmt::format(
      R"(<svg class="histogram" width="{0}" height="{1}" viewBox="0 0 {0} {1}" role="img" )"
      R"(aria-label="Histogram of relative depth errors">)",
      kWidth, kHeight);
  const double bar = kPlotWidth / kHistogramBins;
  for (int i = 0; i < kHistogramBins; ++i) {
    const auto count = metrics.histogram[static_cast<std::size_t>(i)];
    if (count == 0) continue;
    const double height = std::max(2.0, scale * std::log1p(double(count)));
    const double from = std::pow(10.0, kHistogramLow + double(i) / kBinsPerDecade);
    svg += fmt::format(
        R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"><title>{} {}: {} px</title></rect>)",
        kLeft + i * bar + 0.5, kHeight - kBottom - height, bar - 1.0, height,
        i == 0 ? "below" : "from", format_error(i == 0 ? from * std::pow(10.0, 0.25) : from),
        count);
  }
  svg += fmt::format(R"(<line class="axis" x1="{}" x2="{}" y1="{}" y2="{}"/>)", kLeft,
                     kWidth - kRight, kHeight - kBottom, kHeight - kBottom);
  for (int decade = kHistogramLow; decade <= kHistogramHigh; decade += 2) {
    const double x = position(std::pow(10.0, decade));
    svg += fmt::format(R"(<text x="{:.1f}" y="{}" text-anchor="{}">1e{}</text>)", x, kHeight - 16,
                       decade == kHistogramLow ? "start" : "middle", decade);
  }
  svg += fmt::format(
      R"(<text x="{}" y="{}" text-anchor="end">relative depth error, {} interior px, log count</text>)",
      kWidth - kRight, kHeight - 3, metrics.interior);
  for (const Check& check : checks) {
    if (check.name == "depth-median") svg += limit_line(check, "median", 10);
    if (check.name == "depth-p99") svg += limit_line(check, "p99", 21);
  }
  svg += "</svg>";
  return svg;
}

}  // namespace octrace::validation
