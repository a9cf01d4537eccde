#include "tests/bench/growth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "tests/bench/svg_chart.h"

namespace octrace::bench {

namespace {

using nlohmann::json;

double number(const json& row, const char* key) { return row.at(key).get<double>(); }

double log_of(const json& row) { return std::log2(number(row, "triangles")); }

double work_per_log(const json& row) {
  return (number(row, "nodes_per_ray") + number(row, "triangles_per_ray")) / log_of(row);
}

double peer_time_per_log(const json& row) {
  return 1e3 / number(row, "peer_mrays_per_s") / log_of(row);
}

std::vector<const json*> of_set(const json& rows, const std::string& set) {
  std::vector<const json*> result;
  for (const json& row : rows) {
    if (row.value("set", "") == set) result.push_back(&row);
  }
  return result;
}

constexpr const char* kSets[] = {"primary", "bounce", "ao"};
// Okabe and Ito's colours, told apart by the colour-blind.
constexpr const char* kColors[] = {"#0072b2", "#d55e00", "#009e73"};

}  // namespace

void add_growth(json& rows) {
  std::stable_sort(rows.begin(), rows.end(), [](const json& a, const json& b) {
    return number(a, "triangles") < number(b, "triangles");
  });
  std::map<std::string, const json*> before;
  for (json& row : rows) {
    if (!row.contains("set")) continue;
    row["time_per_log"] = 1e3 / number(row, "mrays_per_s") / log_of(row);
    const json*& last = before[row["set"].get<std::string>()];
    if (last != nullptr) {
      row["time_per_log_step"] = number(row, "time_per_log") / number(*last, "time_per_log");
      row["work_per_log_step"] = work_per_log(row) / work_per_log(*last);
    }
    last = &row;
  }
}

std::string growth_report(const json& rows) {
  std::string text;
  for (const char* set : kSets) {
    const std::vector<const json*> sizes = of_set(rows, set);
    for (const json* row : sizes) {
      text += fmt::format("{:<8} {:>9.0f} triangles: {:7.1f} ns a ray, {:6.2f} ns / log2", set,
                          number(*row, "triangles"), 1e3 / number(*row, "mrays_per_s"),
                          number(*row, "time_per_log"));
      if (row->contains("time_per_log_step")) {
        text += fmt::format(", {:.2f} of the size before; nodes and triangles visited {:.2f}",
                            number(*row, "time_per_log_step"), number(*row, "work_per_log_step"));
      }
      text += "\n";
    }
    if (sizes.size() < 2) continue;
    const json &first = *sizes.front(), &last = *sizes.back();
    text += fmt::format("{:<8} in all: time / log2 {:.2f} x, nodes and triangles / log2 {:.2f} x",
                        set, number(last, "time_per_log") / number(first, "time_per_log"),
                        work_per_log(last) / work_per_log(first));
    if (first.contains("peer_mrays_per_s") && last.contains("peer_mrays_per_s")) {
      text += fmt::format("; Embree's time / log2 {:.2f} x",
                          peer_time_per_log(last) / peer_time_per_log(first));
    }
    text += "\n";
  }
  return text;
}

std::string growth_svg(const json& rows, const std::string& note) {
  Chart speed{"Mrays/s", "triangles", "Mrays/s", {}, true, {}, true};
  Chart builds{"Time of a build", "triangles", "seconds", {}, true, {}, true};
  for (const json* row : of_set(rows, kSets[0])) {
    speed.x_ticks.push_back(number(*row, "triangles"));
    builds.x_ticks.push_back(number(*row, "triangles"));
  }
  for (std::size_t i = 0; i < std::size(kSets); ++i) {
    ChartSeries own{fmt::format("octrace, {}", kSets[i]), kColors[i], {}};
    ChartSeries peer{fmt::format("Embree high, {}", kSets[i]), kColors[i], {}, true};
    for (const json* row : of_set(rows, kSets[i])) {
      own.points.emplace_back(number(*row, "triangles"), number(*row, "mrays_per_s"));
      if (row->contains("peer_mrays_per_s")) {
        peer.points.emplace_back(number(*row, "triangles"), number(*row, "peer_mrays_per_s"));
      }
    }
    speed.series.push_back(own);
    speed.series.push_back(peer);
  }
  const ChartSeries builders[] = {{"octrace sah", kColors[0], {}},
                                  {"embree medium", kColors[1], {}, true},
                                  {"embree high", kColors[2], {}, true}};
  for (ChartSeries series : builders) {
    for (const json& row : rows) {
      if (row.value("builder", "") != series.label || row.contains("set")) continue;
      series.points.emplace_back(number(row, "triangles"), 1e-3 * number(row, "ms"));
    }
    builds.series.push_back(series);
  }
  return svg_page("Growth with the scene: a terrain of n x n quads", {speed, builds}, {note});
}

}  // namespace octrace::bench
