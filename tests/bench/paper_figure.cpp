// Figure 3 of the paper with its data and ours: speed-up by distance, and of each repeat.
#include <fmt/format.h>

#include "tests/bench/paper.h"
#include "tests/bench/statistics.h"
#include "tests/bench/svg_chart.h"

namespace octrace::bench {

namespace {

// Okabe and Ito's colours, told apart by the colour-blind.
constexpr const char* kPaperColor = "#000000";
constexpr const char* kSeedColor = "#d55e00";
constexpr const char* kFastColor = "#0072b2";
constexpr const char* kCpuColor = "#009e73";

double of_medians(const std::vector<double>& slow, const std::vector<double>& fast) {
  return spread_of(slow).median / spread_of(fast).median;
}

Chart by_distance(const PaperResult& result) {
  Chart chart{"Speed-up at four distances", "Z of the eye", "times as fast", {}, true, {}};
  ChartSeries paper{"the paper: GeForce 9800 GT over one core of 2008", kPaperColor, {}, true};
  ChartSeries seed{"the seed's algorithm: GPU over one CPU core", kSeedColor, {}};
  ChartSeries fast{"octrace: GPU over one CPU core", kFastColor, {}};
  ChartSeries cpu{"octrace over the seed, both on one CPU core", kCpuColor, {}};
  for (const PaperFigures& p : kPaperTable) {
    paper.points.emplace_back(p.z, p.cpu_seconds / p.gpu_seconds);
  }
  for (const PaperRow& row : result.rows) {
    const PaperTimes& t = row.times;
    chart.x_ticks.push_back(row.z);
    if (!t.seed_gpu.empty()) seed.points.emplace_back(row.z, of_medians(t.seed_cpu, t.seed_gpu));
    if (!t.fast_gpu.empty()) fast.points.emplace_back(row.z, of_medians(t.fast_cpu, t.fast_gpu));
    cpu.points.emplace_back(row.z, of_medians(t.seed_cpu, t.fast_cpu));
  }
  chart.series = {fast, seed, paper, cpu};
  return chart;
}

Chart by_repeat(const PaperResult& result) {
  Chart chart{fmt::format("Every repeat at Z = {}", kPaperRepeatedZ),
              "repeat",
              "times as fast",
              {},
              true,
              {}};
  ChartSeries paper{
      fmt::format("the paper's mean of ten: {}", kPaperMeanSpeedUp), kPaperColor, {}, true, false};
  ChartSeries seed{"the seed's algorithm: GPU over one CPU core", kSeedColor, {}};
  ChartSeries fast{"octrace: GPU over one CPU core", kFastColor, {}};
  ChartSeries cpu{"octrace over the seed, both on one CPU core", kCpuColor, {}};
  const auto add = [](ChartSeries& series, const std::vector<double>& values) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      series.points.emplace_back(static_cast<double>(i + 1), values[i]);
    }
  };
  const int step = (result.options.repeats + 9) / 10;
  for (int i = 1; i <= result.options.repeats; i += step) chart.x_ticks.push_back(i);
  for (const PaperRow& row : result.rows) {
    if (row.z != kPaperRepeatedZ) continue;
    add(seed, ratios(row.times.seed_cpu, row.times.seed_gpu));
    add(fast, ratios(row.times.fast_cpu, row.times.fast_gpu));
    add(cpu, ratios(row.times.seed_cpu, row.times.fast_cpu));
  }
  paper.points = {{1.0, kPaperMeanSpeedUp},
                  {static_cast<double>(result.options.repeats), kPaperMeanSpeedUp}};
  chart.series = {fast, seed, paper, cpu};
  return chart;
}

}  // namespace

std::string paper_svg(const PaperResult& result) {
  const PaperOptions& o = result.options;
  return svg_page(
      "Speed-up of octree ray tracing on the GPU (figure 3 of Wang et al. 2012)",
      {by_distance(result), by_repeat(result)},
      {fmt::format("{} vertices, {} triangles, {} x {} pixels; medians of {} repeats; a GPU's time "
                   "ends with the image in host memory.",
                   result.vertices, result.triangles, o.width, o.height, o.repeats),
       fmt::format("CPU: {}, one core. GPU: {}.", result.cpu,
                   result.gpu_missing.empty() ? result.gpu : "no figures, " + result.gpu_missing)});
}

}  // namespace octrace::bench
