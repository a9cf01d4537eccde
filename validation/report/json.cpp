#include <cmath>
#include <nlohmann/json.hpp>

#include "validation/report/report.h"

namespace octrace::validation {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json("infinity"); }

std::string_view kind_name(DisagreementKind kind) {
  switch (kind) {
    case DisagreementKind::mask:
      return "mask";
    case DisagreementKind::depth:
      return "depth";
    case DisagreementKind::object_id:
      return "object_id";
  }
  return "";
}

Json geometry_json(const GeometryMetrics& m) {
  Json out{{"width", m.width},
           {"height", m.height},
           {"covered", {m.covered_a, m.covered_b}},
           {"mask_total", m.mask_total},
           {"mask_far", m.mask_far},
           {"iou", m.iou}};
  if (m.has_depth) {
    out["interior"] = m.interior;
    out["depth_median"] = number(m.depth_median);
    out["depth_p99"] = number(m.depth_p99);
    out["depth_max"] = number(m.depth_max);
    out["outliers"] = m.outliers;
    out["histogram"] = {
        {"low", kHistogramLow}, {"bins_per_decade", kBinsPerDecade}, {"counts", m.histogram}};
  }
  if (m.has_ids) out["ids_differ"] = m.ids_differ;
  out["largest_disagreements"] = Json::array();
  for (const Disagreement& d : m.worst) {
    out["largest_disagreements"].push_back({{"kind", kind_name(d.kind)},
                                            {"pixel", {d.x, d.y}},
                                            {"values", {number(d.a), number(d.b)}},
                                            {"error", number(d.error)}});
  }
  return out;
}

}  // namespace

std::string report_json(const Report& report) {
  const Totals sum = totals(report);
  Json root{{"title", report.title},
            {"totals",
             {{"comparisons", sum.comparisons},
              {"agree", sum.agree},
              {"differ", sum.differ},
              {"exceptions", sum.exceptions},
              {"errors", sum.errors}}}};
  for (const auto& [name, text] : report.facts) root["facts"][name] = text;
  for (const auto& [name, tolerances] : report.tolerances) {
    for (const ToleranceField& field : kToleranceFields) {
      root["tolerances"][name][std::string(field.name)] = tolerances.*field.value;
    }
  }
  root["comparisons"] = Json::array();
  for (const Comparison& comparison : report.comparisons) {
    Json entry{{"scene", comparison.scene},
               {"camera", comparison.camera},
               {"images", {comparison.first, comparison.second}},
               {"status", status_name(comparison.status)}};
    if (!comparison.cause.empty()) entry["cause"] = comparison.cause;
    if (!comparison.notes.empty()) entry["notes"] = comparison.notes;
    for (const Check& check : comparison.checks) {
      entry["checks"].push_back({{"name", check.name},
                                 {"value", number(check.value)},
                                 {check.at_least ? "at_least" : "at_most", check.limit},
                                 {"passed", check.passed()}});
    }
    if (comparison.geometry) entry["geometry"] = geometry_json(*comparison.geometry);
    if (comparison.beauty) {
      entry["beauty"] = {{"rmse", number(comparison.beauty->rmse)},
                         {"flip_mean", number(comparison.beauty->flip_mean)},
                         {"flip_max", number(comparison.beauty->flip_max)}};
    }
    root["comparisons"].push_back(std::move(entry));
  }
  // Names come from files of other people: what is not UTF-8 is replaced rather than thrown over.
  return root.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace octrace::validation
