#include "validation/compare/geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace octrace::validation {
namespace {

using util::Error;
using util::Exit;

// The 3x3 neighbourhood of a pixel, clipped by the image.
template <class Visit>
void around(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height,
            Visit visit) {
  const std::uint32_t x0 = x > 0 ? x - 1 : 0, x1 = std::min(x + 1, width - 1);
  const std::uint32_t y0 = y > 0 ? y - 1 : 0, y1 = std::min(y + 1, height - 1);
  for (std::uint32_t v = y0; v <= y1; ++v) {
    for (std::uint32_t u = x0; u <= x1; ++u) visit(std::size_t{v} * width + u);
  }
}

bool on_edge(const Planes& planes, std::uint32_t x, std::uint32_t y) {
  bool any = false, all = true;
  around(x, y, planes.width, planes.height, [&](std::size_t i) {
    any = any || planes.mask[i];
    all = all && planes.mask[i];
  });
  return any && !all;
}

bool is_interior(const Planes& a, const Planes& b, std::uint32_t x, std::uint32_t y) {
  bool covered = true;
  float nearest = std::numeric_limits<float>::infinity(), farthest = 0.0f;
  around(x, y, a.width, a.height, [&](std::size_t i) {
    covered = covered && a.mask[i] && b.mask[i];
    if (b.z.empty()) return;
    nearest = std::min(nearest, b.z[i]);
    farthest = std::max(farthest, b.z[i]);
  });
  if (!covered) return false;
  return b.z.empty() || farthest - nearest <= kDepthJump * std::abs(nearest);
}

double relative_error(float a, float b) {
  if (a == b) return 0.0;
  const double error = std::abs(double{a} - double{b}) / std::abs(double{b});
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
}

int histogram_bin(double error) {
  if (!(error > 0.0)) return 0;
  const double bin = (std::log10(error) - kHistogramLow) * kBinsPerDecade;
  return static_cast<int>(std::clamp(std::floor(bin), 0.0, kHistogramBins - 1.0));
}

// Nearest rank: the smallest value that at least `share` of all values do not exceed.
double percentile(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  const double rank = std::ceil(share * static_cast<double>(values.size()));
  const auto index = static_cast<std::ptrdiff_t>(std::max(rank, 1.0)) - 1;
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

// Keeps the largest few; the first of equals, so that the order is that of the pixels.
void keep_worst(std::vector<Disagreement>& worst, const Disagreement& candidate) {
  const auto larger = [](const Disagreement& x, const Disagreement& y) {
    return x.error > y.error;
  };
  if (worst.size() == kWorst && !larger(candidate, worst.back())) return;
  worst.insert(std::upper_bound(worst.begin(), worst.end(), candidate, larger), candidate);
  if (worst.size() > kWorst) worst.pop_back();
}

}  // namespace

std::vector<float> depth_errors(const Planes& a, const Planes& b) {
  std::vector<float> errors(a.mask.size(), -1.0f);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (a.mask[i] && b.mask[i]) errors[i] = static_cast<float>(relative_error(a.z[i], b.z[i]));
  }
  return errors;
}

util::Result<GeometryMetrics> compare_geometry(const Planes& a, const Planes& b,
                                               const Tolerances& tolerances) {
  if (a.width != b.width || a.height != b.height) {
    return Error{Exit::invalid_input, "",
                 fmt::format("the images differ in size: {}x{} and {}x{}", a.width, a.height,
                             b.width, b.height),
                 "", ""};
  }
  if (a.mask.empty() || b.mask.empty()) {
    return Error{Exit::invalid_input, "",
                 fmt::format("the {} image has neither depth nor mask nor alpha",
                             a.mask.empty() ? "first" : "second"),
                 "", ""};
  }

  GeometryMetrics metrics;
  metrics.width = a.width;
  metrics.height = a.height;
  metrics.has_depth = !a.z.empty() && !b.z.empty();
  metrics.has_ids = !a.object_id.empty() && !b.object_id.empty();
  std::vector<double> interior;
  std::vector<Disagreement> worst_depths, worst_masks, worst_ids;
  for (std::uint32_t y = 0; y < a.height; ++y) {
    for (std::uint32_t x = 0; x < a.width; ++x) {
      const std::size_t i = std::size_t{y} * a.width + x;
      metrics.covered_a += a.mask[i];
      metrics.covered_b += b.mask[i];
      if (a.mask[i] != b.mask[i]) {
        const bool near = on_edge(a, x, y) && on_edge(b, x, y);
        ++metrics.mask_total;
        metrics.mask_far += !near;
        keep_worst(worst_masks, {DisagreementKind::mask, x, y, double(a.mask[i]), double(b.mask[i]),
                                 near ? 0.5 : 1.0});
        continue;
      }
      if (!a.mask[i]) continue;
      ++metrics.covered_both;
      const double error = metrics.has_depth ? relative_error(a.z[i], b.z[i]) : 0.0;
      if (error > 0.0)
        keep_worst(worst_depths, {DisagreementKind::depth, x, y, a.z[i], b.z[i], error});
      metrics.outliers += error > tolerances.outlier_error;
      if (!is_interior(a, b, x, y)) continue;
      ++metrics.interior;
      if (metrics.has_depth) {
        interior.push_back(error);
        ++metrics.histogram[static_cast<std::size_t>(histogram_bin(error))];
      }
      if (metrics.has_ids && a.object_id[i] != b.object_id[i]) {
        ++metrics.ids_differ;
        keep_worst(worst_ids, {DisagreementKind::object_id, x, y, double(a.object_id[i]),
                               double(b.object_id[i]), 1.0});
      }
    }
  }

  const std::uint64_t either = metrics.covered_both + metrics.mask_total;
  metrics.iou = either == 0 ? 1.0 : double(metrics.covered_both) / double(either);
  metrics.depth_median = percentile(interior, 0.5);
  metrics.depth_p99 = percentile(interior, 0.99);
  metrics.depth_max = percentile(interior, 1.0);
  for (const auto& list : {worst_masks, worst_depths, worst_ids}) {
    metrics.worst.insert(metrics.worst.end(), list.begin(), list.end());
  }
  return metrics;
}

std::vector<Check> judge(const GeometryMetrics& metrics, const Tolerances& tolerances) {
  std::vector<Check> checks{
      {"mask-total", double(metrics.mask_total), tolerances.mask_total, false},
      {"mask-far", double(metrics.mask_far), tolerances.mask_far, false},
      {"iou", metrics.iou, tolerances.iou, true},
  };
  if (metrics.has_depth) {
    const double share = tolerances.outlier_share * double(metrics.covered_both);
    checks.push_back({"depth-median", metrics.depth_median, tolerances.depth_median, false});
    checks.push_back({"depth-p99", metrics.depth_p99, tolerances.depth_p99, false});
    checks.push_back({"outlier-count", double(metrics.outliers),
                      std::max(tolerances.outlier_count, share), false});
  }
  if (metrics.has_ids) {
    const double share = tolerances.id_share * double(metrics.interior);
    checks.push_back(
        {"id-share", double(metrics.ids_differ), std::max(tolerances.outlier_count, share), false});
  }
  return checks;
}

}  // namespace octrace::validation
