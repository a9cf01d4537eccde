// The seed's experiment: measured, then told as text, as JSON and as a picture.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::bench {

struct PaperOptions {
  int width = 800, height = 600;
  int repeats = 10;
  std::uint32_t threshold = 8;   // most vertices in a leaf of the seed's octree
  std::uint32_t band_rows = 20;  // of one launch of the seed's kernel
  bool gpu = true;               // where there is one
  int gpu_index = 0;
};

// Seconds of each repeat.
struct PaperTimes {
  std::vector<double> seed_cpu, fast_cpu;
  // On the GPU: one image from the launch to its hits in the host's memory, and the kernels alone.
  std::vector<double> seed_gpu, fast_gpu, seed_kernels, fast_kernels;
};

struct PaperRow {
  int z = 0;
  PaperTimes times;
  double hit_share = 0.0;               // of the pixels
  double cpu_agreement = 0.0;           // of the seed's hits with octrace's on the CPU
  std::optional<double> gpu_agreement;  // of the seed's on the GPU with octrace's on the CPU
  std::optional<std::uint64_t> seed_differing, fast_differing;  // pixels that differ, CPU and GPU
};

struct PaperResult {
  PaperOptions options;
  std::size_t vertices = 0, triangles = 0, seed_nodes = 0, fast_nodes = 0;
  std::uint32_t seed_depth = 0;
  std::string cpu, instruction_set, gpu;
  std::string gpu_missing;  // why there are no figures of a GPU; empty: there are
  std::vector<PaperRow> rows;
};

// Table 1 of the paper, and what it says of ten runs at Z = 400: one core of 2008 and a GeForce
// 9800 GT, 800 x 600.
struct PaperFigures {
  int z;
  double cpu_seconds, gpu_seconds;
};
inline constexpr PaperFigures kPaperTable[] = {
    {700, 22.9, 1.72}, {600, 22.5, 1.71}, {500, 22.3, 1.69}, {400, 21.0, 1.59}};
inline constexpr double kPaperMeanSpeedUp = 13.6;
inline constexpr int kPaperRepeatedZ = 400;

// Nothing is timed before the hits were compared; less than kLeastAgreement is an error (exit 1).
util::Result<PaperResult> run_paper(const PaperOptions& options);

std::string paper_text(const PaperResult& result);
nlohmann::json paper_json(const PaperResult& result);
std::string paper_svg(const PaperResult& result);

// Of each repeat: how many times as long the first takes.
std::vector<double> ratios(const std::vector<double>& slow, const std::vector<double>& fast);

}  // namespace octrace::bench
