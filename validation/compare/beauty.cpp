#include "validation/compare/beauty.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "validation/compare/flip.h"

namespace octrace::validation {

util::Result<BeautyMetrics> compare_beauty(const Planes& a, const Planes& b) {
  if (a.width != b.width || a.height != b.height) {
    return util::Error{util::Exit::invalid_input, "",
                       fmt::format("the images differ in size: {}x{} and {}x{}", a.width, a.height,
                                   b.width, b.height),
                       "", ""};
  }
  if (a.rgb.empty() || b.rgb.empty()) {
    return util::Error{
        util::Exit::invalid_input, "",
        fmt::format("the {} image has no channels R, G, B", a.rgb.empty() ? "first" : "second"), "",
        ""};
  }
  BeautyMetrics metrics;
  double squares = 0.0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) {
    const double error =
        std::clamp(double{a.rgb[i]}, 0.0, 1.0) - std::clamp(double{b.rgb[i]}, 0.0, 1.0);
    squares += error * error;
  }
  metrics.rmse = std::sqrt(squares / static_cast<double>(a.rgb.size()));
  metrics.flip = flip(b.rgb, a.rgb, a.width, a.height);
  double sum = 0.0;
  for (const float value : metrics.flip) {
    sum += value;
    metrics.flip_max = std::max(metrics.flip_max, double{value});
  }
  metrics.flip_mean = sum / static_cast<double>(metrics.flip.size());
  return metrics;
}

std::vector<Check> judge(const BeautyMetrics& metrics, const Tolerances& tolerances) {
  return {{"rmse", metrics.rmse, tolerances.rmse, false},
          {"flip", metrics.flip_mean, tolerances.flip, false}};
}

}  // namespace octrace::validation
