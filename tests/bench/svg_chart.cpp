#include "tests/bench/svg_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace octrace::bench {

namespace {

constexpr double kPanel = 480.0;                   // width of a chart with its labels
constexpr double kLeft = 66.0;                     // of the plot inside the panel
constexpr double kWidth = 390.0, kHeight = 290.0;  // of the plot
constexpr double kTop = 84.0;
constexpr double kLine = 19.0;  // of the legend and the notes

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string text_at(double x, double y, const char* anchor, int size, const std::string& text,
                    const std::string& extra = "") {
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\"{}>{}</text>\n", x, y,
      anchor, size, extra, escaped(text));
}

std::string line(double x1, double y1, double x2, double y2, const char* style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1,
                     x2, y2, style);
}

// 1, 2 and 5 times powers of ten.
double round_step(double range, int most) {
  const double power = std::pow(10.0, std::floor(std::log10(range / most)));
  for (const double factor : {1.0, 2.0, 5.0, 10.0}) {
    if (range / (power * factor) <= most) return power * factor;
  }
  return power * 10.0;
}

std::string short_number(double value) {
  if (value >= 1e6) return fmt::format("{:.3g}M", value * 1e-6);
  return value >= 1e3 ? fmt::format("{:.3g}k", value * 1e-3) : fmt::format("{:.3g}", value);
}

class Axis {
 public:
  Axis(const Chart& chart) : log_(chart.log_y) {
    double low = INFINITY, high = -INFINITY;
    for (const ChartSeries& series : chart.series) {
      for (const auto& [x, y] : series.points) {
        low = std::min(low, y);
        high = std::max(high, y);
      }
    }
    if (!(low <= high)) low = high = 1.0;
    if (log_) {
      low_ = std::pow(10.0, std::floor(std::log10(low)));
      high_ = std::pow(10.0, std::ceil(std::log10(high)));
      if (high_ <= low_) high_ = low_ * 10.0;
      const bool fine = high_ / low_ <= 100.0;
      for (double decade = low_; decade <= high_ * 1.001; decade *= 10.0) {
        for (const double factor : {1.0, 2.0, 5.0}) {
          if ((fine || factor == 1.0) && decade * factor <= high_ * 1.001) {
            ticks_.push_back(decade * factor);
          }
        }
      }
    } else {
      const double step = round_step(std::max(high, 1e-12), 6);
      low_ = 0.0;
      high_ = std::ceil(high / step * 1.0001) * step;
      for (int i = 0; i * step <= high_ * 1.001; ++i) ticks_.push_back(i * step);
    }
  }

  double at(double y) const {
    const double share =
        log_ ? std::log(y / low_) / std::log(high_ / low_) : (y - low_) / (high_ - low_);
    return kTop + kHeight * (1.0 - share);
  }
  const std::vector<double>& ticks() const { return ticks_; }

 private:
  bool log_;
  double low_ = 0.0, high_ = 1.0;
  std::vector<double> ticks_;
};

std::string key_style(const ChartSeries& series) {
  return fmt::format("stroke=\"{}\" stroke-width=\"2\" fill=\"none\"{}", series.color,
                     series.dashed ? " stroke-dasharray=\"6 4\"" : "");
}

std::string draw_series(const ChartSeries& series, const Axis& axis, const auto& x_at) {
  if (series.points.empty()) return "";
  std::string path, marks;
  for (const auto& [x, y] : series.points) {
    path += fmt::format("{:.1f},{:.1f} ", x_at(x), axis.at(y));
    if (series.marks) {
      marks += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\" fill=\"{}\"/>\n", x_at(x),
                           axis.at(y), series.color);
    }
  }
  path.pop_back();
  return fmt::format("<polyline points=\"{}\" {}/>\n{}", path, key_style(series), marks);
}

std::string draw_chart(const Chart& chart, double left) {
  const Axis axis(chart);
  const double bottom = kTop + kHeight;
  const auto scaled = [&](double x) { return chart.log_x ? std::log(x) : x; };
  const double first = scaled(chart.x_ticks.front()), last = scaled(chart.x_ticks.back());
  const auto x_at = [&](double x) {
    const double share = last == first ? 0.5 : (scaled(x) - first) / (last - first);
    return left + 16.0 + (kWidth - 32.0) * share;
  };
  std::string svg = text_at(left + kWidth / 2, kTop - 14, "middle", 14, chart.title);
  for (const double tick : axis.ticks()) {
    const double y = axis.at(tick);
    svg += line(left, y, left + kWidth, y, "stroke=\"#dddddd\"");
    svg += text_at(left - 8, y + 4, "end", 12, fmt::format("{:.6g}", tick));
  }
  for (const double tick : chart.x_ticks) {
    svg += line(x_at(tick), bottom, x_at(tick), bottom + 5, "stroke=\"#333333\"");
    svg += text_at(x_at(tick), bottom + 19, "middle", 12,
                   chart.log_x ? short_number(tick) : fmt::format("{:.6g}", tick));
  }
  svg += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
      "fill=\"none\" stroke=\"#333333\"/>\n",
      left, kTop, kWidth, kHeight);
  svg += text_at(left + kWidth / 2, bottom + 38, "middle", 13, chart.x_label);
  const double middle = kTop + kHeight / 2, beside = left - 50;
  svg += text_at(beside, middle, "middle", 13, chart.y_label,
                 fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", beside, middle));
  double y = bottom + 62;
  for (const ChartSeries& series : chart.series) {
    svg += draw_series(series, axis, x_at);
    svg += line(left, y - 4, left + 28, y - 4, key_style(series).c_str());
    svg += text_at(left + 36, y, "start", 12,
                   series.label + (series.points.empty() ? " (not measured)" : ""));
    y += kLine;
  }
  return svg;
}

}  // namespace

std::string svg_page(const std::string& title, const std::vector<Chart>& charts,
                     const std::vector<std::string>& notes) {
  std::size_t most_series = 0;
  for (const Chart& chart : charts) most_series = std::max(most_series, chart.series.size());
  const double legend_end = kTop + kHeight + 56 + kLine * static_cast<double>(most_series);
  const double height = legend_end + kLine * (static_cast<double>(notes.size()) + 1.0);
  const double width = kPanel * static_cast<double>(charts.size()) + 20;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
      "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" fill=\"#222222\">\n"
      "<title>{2}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
      width, height, escaped(title));
  svg += text_at(width / 2, 32, "middle", 17, title);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    svg += draw_chart(charts[i], kPanel * static_cast<double>(i) + kLeft);
  }
  double y = legend_end + kLine * 0.7;
  for (const std::string& note : notes) {
    svg += text_at(kLeft, y, "start", 12, note);
    y += kLine;
  }
  return svg + "</svg>\n";
}

}  // namespace octrace::bench
