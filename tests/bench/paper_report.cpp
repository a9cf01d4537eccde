// The experiment's figures as text and as JSON, the paper's beside ours.
#include <fmt/format.h>

#include "tests/bench/paper.h"
#include "tests/bench/statistics.h"

namespace octrace::bench {

namespace {

std::string milliseconds(const std::vector<double>& seconds) {
  if (seconds.empty()) return "-";
  const Spread s = spread_of(seconds);
  return fmt::format("{:.4g} [{:.4g}, {:.4g}]", s.median * 1e3, s.lowest * 1e3, s.highest * 1e3);
}

std::string speed_up(const std::vector<double>& slow, const std::vector<double>& fast) {
  if (slow.empty() || fast.empty()) return "-";
  return fmt::format("{:.1f}", spread_of(slow).median / spread_of(fast).median);
}

std::string side(const char* name, const PaperResult& result, std::vector<double> PaperTimes::*cpu,
                 std::vector<double> PaperTimes::*gpu, std::vector<double> PaperTimes::*kernels) {
  std::string text =
      fmt::format("{}\n{:>6}  {:<26}{:<28}{:>9}  {:<28}{:>12}\n", name, "Z", "one CPU core, ms",
                  "GPU image, ms", "speed-up", "GPU kernels, ms", "speed-up");
  for (const PaperRow& row : result.rows) {
    const PaperTimes& t = row.times;
    text += fmt::format("{:>6}  {:<26}{:<28}{:>9}  {:<28}{:>12}\n", row.z, milliseconds(t.*cpu),
                        milliseconds(t.*gpu), speed_up(t.*cpu, t.*gpu), milliseconds(t.*kernels),
                        speed_up(t.*cpu, t.*kernels));
  }
  return text;
}

std::string agreement_text(const PaperResult& result) {
  std::string text;
  for (const PaperRow& row : result.rows) {
    text += fmt::format(
        "Z = {}: {:.1f} % of the pixels hit; the seed's hits agree with octrace's "
        "on {:.4f} %",
        row.z, 100.0 * row.hit_share, 100.0 * row.cpu_agreement);
    if (row.seed_differing && row.fast_differing) {
      text += fmt::format("; CPU and GPU differ in {} pixels (seed) and {} (octrace)",
                          *row.seed_differing, *row.fast_differing);
    }
    text += "\n";
  }
  return text;
}

std::string figure_data(const PaperResult& result) {
  std::string text = "Figure 3, left: speed-up of the GPU's image over one CPU core\n";
  text += fmt::format("{:>6}{:>10}{:>10}{:>10}{:>22}\n", "Z", "paper", "seed", "octrace",
                      "octrace/seed, CPU");
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    const PaperTimes& t = result.rows[i].times;
    text += fmt::format("{:>6}{:>10.1f}{:>10}{:>10}{:>22}\n", result.rows[i].z,
                        kPaperTable[i].cpu_seconds / kPaperTable[i].gpu_seconds,
                        speed_up(t.seed_cpu, t.seed_gpu), speed_up(t.fast_cpu, t.fast_gpu),
                        speed_up(t.seed_cpu, t.fast_cpu));
  }
  text += fmt::format("Figure 3, right: the repeats at Z = {} (the paper's mean of ten: {})\n",
                      kPaperRepeatedZ, kPaperMeanSpeedUp);
  for (const PaperRow& row : result.rows) {
    if (row.z != kPaperRepeatedZ) continue;
    const PaperTimes& t = row.times;
    const auto list = [&](const char* name, const std::vector<double>& values) {
      text += fmt::format("{:>20}:", name);
      for (const double value : values) text += fmt::format(" {:.1f}", value);
      text += values.empty() ? " -\n" : "\n";
    };
    list("seed", ratios(t.seed_cpu, t.seed_gpu));
    list("octrace", ratios(t.fast_cpu, t.fast_gpu));
    list("octrace/seed, CPU", ratios(t.seed_cpu, t.fast_cpu));
  }
  return text;
}

nlohmann::json times_json(const std::vector<double>& seconds) {
  if (seconds.empty()) return nullptr;
  const Spread s = spread_of(seconds);
  return {
      {"median_s", s.median}, {"lowest_s", s.lowest}, {"highest_s", s.highest}, {"all_s", seconds}};
}

nlohmann::json speed_up_json(const std::vector<double>& slow, const std::vector<double>& fast) {
  if (slow.empty() || fast.empty()) return nullptr;
  return {{"of_medians", spread_of(slow).median / spread_of(fast).median},
          {"all", ratios(slow, fast)}};
}

nlohmann::json side_json(const std::vector<double>& cpu, const std::vector<double>& gpu,
                         const std::vector<double>& kernels) {
  return {{"cpu", times_json(cpu)},
          {"gpu", times_json(gpu)},
          {"gpu_kernels", times_json(kernels)},
          {"speed_up", speed_up_json(cpu, gpu)},
          {"speed_up_kernels", speed_up_json(cpu, kernels)}};
}

}  // namespace

std::string paper_text(const PaperResult& result) {
  const PaperOptions& o = result.options;
  std::string text = fmt::format(
      "builtin:paper: {} vertices, {} triangles, {}x{}, median and spread of {} repeats\n"
      "seed: median octree of {} nodes in {} levels, threshold {}, bands of {} rows; octrace: {} "
      "nodes\n"
      "CPU: {}, one core, octrace with {}\nGPU: {}\n\n",
      result.vertices, result.triangles, o.width, o.height, o.repeats, result.seed_nodes,
      result.seed_depth, o.threshold, o.band_rows, result.fast_nodes, result.cpu,
      result.instruction_set,
      result.gpu_missing.empty() ? result.gpu : "no figures: " + result.gpu_missing);
  text += agreement_text(result);
  text += "\nTable 1, the paper: one core of 2008, GeForce 9800 GT, 800x600\n";
  text += fmt::format("{:>6}  {:<26}{:<28}{:>9}\n", "Z", "CPU, ms", "GPU, ms", "speed-up");
  for (const PaperFigures& p : kPaperTable) {
    text += fmt::format("{:>6}  {:<26.0f}{:<28.0f}{:>9.1f}\n", p.z, p.cpu_seconds * 1e3,
                        p.gpu_seconds * 1e3, p.cpu_seconds / p.gpu_seconds);
  }
  text += '\n';
  text += side("Table 1, the seed's algorithm on this machine", result, &PaperTimes::seed_cpu,
               &PaperTimes::seed_gpu, &PaperTimes::seed_kernels);
  text += '\n';
  text += side("Table 1, octrace's own path on this machine", result, &PaperTimes::fast_cpu,
               &PaperTimes::fast_gpu, &PaperTimes::fast_kernels);
  text += '\n';
  text += figure_data(result);
  return text;
}

nlohmann::json paper_json(const PaperResult& result) {
  const PaperOptions& o = result.options;
  nlohmann::json rows = nlohmann::json::array();
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    const PaperRow& row = result.rows[i];
    const PaperTimes& t = row.times;
    nlohmann::json json = {
        {"z", row.z},
        {"hit_share", row.hit_share},
        {"agreement", row.cpu_agreement},
        {"paper",
         {{"cpu_s", kPaperTable[i].cpu_seconds},
          {"gpu_s", kPaperTable[i].gpu_seconds},
          {"speed_up", kPaperTable[i].cpu_seconds / kPaperTable[i].gpu_seconds}}},
        {"seed", side_json(t.seed_cpu, t.seed_gpu, t.seed_kernels)},
        {"octrace", side_json(t.fast_cpu, t.fast_gpu, t.fast_kernels)},
        {"octrace_over_seed_cpu", speed_up_json(t.seed_cpu, t.fast_cpu)},
        {"octrace_over_seed_gpu", speed_up_json(t.seed_gpu, t.fast_gpu)}};
    if (row.gpu_agreement) {
      json["gpu_agreement"] = *row.gpu_agreement;
      json["seed_pixels_differing_cpu_gpu"] = *row.seed_differing;
      json["octrace_pixels_differing_cpu_gpu"] = *row.fast_differing;
    }
    rows.push_back(std::move(json));
  }
  return {{"scene", "builtin:paper"},
          {"vertices", result.vertices},
          {"triangles", result.triangles},
          {"width", o.width},
          {"height", o.height},
          {"repeats", o.repeats},
          {"threshold", o.threshold},
          {"band_rows", o.band_rows},
          {"seed_nodes", result.seed_nodes},
          {"octrace_nodes", result.fast_nodes},
          {"cpu", result.cpu},
          {"instruction_set", result.instruction_set},
          {"gpu", result.gpu.empty() ? nlohmann::json() : nlohmann::json(result.gpu)},
          {"gpu_missing",
           result.gpu_missing.empty() ? nlohmann::json() : nlohmann::json(result.gpu_missing)},
          {"paper_mean_speed_up_at_400", kPaperMeanSpeedUp},
          {"rows", rows}};
}

}  // namespace octrace::bench
