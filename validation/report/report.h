// What a run of comparisons found, as one web page that needs no network and as JSON.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/util/result.h"
#include "validation/compare/beauty.h"
#include "validation/compare/geometry.h"
#include "validation/report/pictures.h"

namespace octrace::validation {

enum class Status {
  agree,
  differ,
  exception,  // the other program lacks a feature that the scene needs: cause says which
  error,      // there is nothing to compare: cause says why
};
std::string_view status_name(Status status);

struct Comparison {
  std::string scene, camera;
  std::string first, second;  // who made the images: "octrace", "POV-Ray"; or file names
  Status status = Status::error;
  std::string cause;  // exception, error
  std::vector<std::string> notes;
  std::optional<GeometryMetrics> geometry;
  std::optional<BeautyMetrics> beauty;
  std::vector<Check> checks;
  Pictures pictures;
};

struct Report {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  // command, versions, date: name and text
  std::vector<std::pair<std::string, Tolerances>> tolerances;  // for whom, which
  std::vector<Comparison> comparisons;
};

struct Totals {
  std::size_t comparisons = 0, agree = 0, differ = 0, exceptions = 0, errors = 0;
};
Totals totals(const Report& report);

// Compares what both images have, sets checks, status and pictures. `what` limits it.
struct CompareOptions {
  Tolerances tolerances = kDefaultTolerances;
  bool geometry = true, beauty = true;
  bool pictures = true;
};
// Errors (exit 3): sizes differ, nothing that both images have.
util::Result<void> fill_comparison(Comparison& comparison, const Planes& a, const Planes& b,
                                   const CompareOptions& options);

// "agree  BoxTextured  camera 0  POV-Ray  mask 0 px, IoU 1, depth median 3.1e-08, p99 7.0e-08, ..."
std::string one_line(const Comparison& comparison);

std::string report_html(const Report& report);
std::string report_json(const Report& report);

// FOLDER/index.html and FOLDER/report.json; the folder is made where it is missing.
util::Result<void> write_report(const Report& report, const std::string& folder);

}  // namespace octrace::validation
