#include "validation/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "backend/util/atomic_file.h"

namespace octrace::validation {

using util::Error;
using util::Exit;
using util::Result;

std::string_view status_name(Status status) {
  switch (status) {
    case Status::agree:
      return "agree";
    case Status::differ:
      return "differ";
    case Status::exception:
      return "exception";
    case Status::error:
      return "error";
  }
  return "error";
}

Totals totals(const Report& report) {
  Totals sum;
  for (const Comparison& comparison : report.comparisons) {
    ++sum.comparisons;
    sum.agree += comparison.status == Status::agree;
    sum.differ += comparison.status == Status::differ;
    sum.exceptions += comparison.status == Status::exception;
    sum.errors += comparison.status == Status::error;
  }
  return sum;
}

Result<void> fill_comparison(Comparison& comparison, const Planes& a, const Planes& b,
                             const CompareOptions& options) {
  const bool geometry = options.geometry && !a.mask.empty() && !b.mask.empty();
  const bool beauty = options.beauty && !a.rgb.empty() && !b.rgb.empty();
  if (!geometry && !beauty) {
    return Error{
        Exit::invalid_input, "",
        "the two images have nothing in common to compare: both need a depth, mask or alpha "
        "channel, or both need R, G and B",
        "", ""};
  }
  comparison.checks.clear();
  if (geometry) {
    auto metrics = compare_geometry(a, b, options.tolerances);
    if (!metrics) return metrics.error();
    comparison.checks = judge(*metrics, options.tolerances);
    if (options.pictures) comparison.pictures = geometry_pictures(a, b, metrics->has_depth);
    comparison.geometry = std::move(*metrics);
  }
  if (beauty) {
    auto metrics = compare_beauty(a, b);
    if (!metrics) return metrics.error();
    const std::vector<Check> checks = judge(*metrics, options.tolerances);
    comparison.checks.insert(comparison.checks.end(), checks.begin(), checks.end());
    if (options.pictures) add_beauty_pictures(comparison.pictures, a, b, *metrics);
    metrics->flip = {};  // the picture has it; two hundred maps would not fit in memory
    comparison.beauty = std::move(*metrics);
  }
  const bool passed = std::all_of(comparison.checks.begin(), comparison.checks.end(),
                                  [](const Check& check) { return check.passed(); });
  comparison.status = passed ? Status::agree : Status::differ;
  return {};
}

std::string one_line(const Comparison& comparison) {
  std::string line = fmt::format("{:<9} {}", status_name(comparison.status), comparison.scene);
  for (const std::string& part : {comparison.camera, comparison.second}) {
    if (!part.empty()) line += "  " + part;
  }
  if (comparison.geometry) {
    const GeometryMetrics& m = *comparison.geometry;
    line += fmt::format("  mask {} px ({} far), IoU {:.6f}", m.mask_total, m.mask_far, m.iou);
    if (m.has_depth) {
      line += fmt::format(", depth median {:.1e} p99 {:.1e} max {:.1e}, {} outliers",
                          m.depth_median, m.depth_p99, m.depth_max, m.outliers);
    }
    if (m.has_ids) line += fmt::format(", {} ids differ", m.ids_differ);
    line += fmt::format(", {} px covered", m.covered_both);
  }
  if (comparison.beauty) {
    line += fmt::format("  RMSE {:.4f}, FLIP {:.4f}", comparison.beauty->rmse,
                        comparison.beauty->flip_mean);
  }
  std::string failed;
  for (const Check& check : comparison.checks) {
    if (!check.passed()) {
      failed += fmt::format("{}{} {:.4g} {} {:.4g}", failed.empty() ? "" : ", ", check.name,
                            check.value, check.at_least ? "<" : ">", check.limit);
    }
  }
  if (!failed.empty()) line += "; beyond tolerance: " + failed;
  if (!comparison.cause.empty()) line += ": " + comparison.cause;
  return line;
}

Result<void> write_report(const Report& report, const std::string& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) {
    return Error{Exit::io, "", "cannot make the report's folder: " + failure.message(), folder, ""};
  }
  if (auto written = util::write_file(folder + "/report.json", report_json(report)); !written) {
    return written.error();
  }
  return util::write_file(folder + "/index.html", report_html(report));
}

}  // namespace octrace::validation
