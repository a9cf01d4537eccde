#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>

#include "backend/app/command.h"
#include "backend/app/options.h"
#include "backend/image/image.h"
#include "backend/util/version.h"
#include "validation/compare/read_planes.h"
#include "validation/report/report.h"

namespace octrace::app {

namespace {

enum class What { all, geometry, beauty };

struct CompareRequest {
  std::string first, second, report;
  std::vector<std::string> tolerances;
  What what = What::all;
  util::Limits limits;
};

constexpr const char* kHelp =
    R"(The second image is the reference: errors are relative to its depths.

Files: EXRs of octrace render (Z, mask, object_id), OpenEXR multilayer of Blender (ViewLayer.Depth.Z
and so on), any OpenEXR with Z or depth, and A or mask; PNGs of POV-Ray with the .json that octrace
export wrote beside the scene. R, G, B of both are compared as beauty: root mean square error and
FLIP (Andersson et al. 2020).

The limits are those for the program that wrote the second image; --tolerance changes one:
  octrace compare a.exr b.exr --tolerance depth-p99=1e-4 --tolerance mask-total=10

Exit code 0: within every limit; 1: not.)";

std::string tolerance_help() {
  std::string names;
  for (const validation::ToleranceField& field : validation::kToleranceFields) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", field.name);
  }
  return "change a limit; may be repeated: " + names;
}

void print_checks(const validation::Comparison& comparison) {
  for (const validation::Check& check : comparison.checks) {
    fmt::print("  {:<14} {:>12.6g}  {} {:<8g} {}\n", check.name, check.value,
               check.at_least ? ">=" : "<=", check.limit, check.passed() ? "" : "beyond tolerance");
  }
  if (!comparison.geometry) return;
  for (const validation::Disagreement& d : comparison.geometry->worst) {
    const char* kind = d.kind == validation::DisagreementKind::mask    ? "mask"
                       : d.kind == validation::DisagreementKind::depth ? "depth"
                                                                       : "object id";
    fmt::print("  {} at pixel ({}, {}): {:.9g} and {:.9g}\n", kind, d.x, d.y, d.a, d.b);
  }
}

util::Result<util::Exit> run_compare(const CompareRequest& request) {
  image::preload();
  auto first = validation::read_planes(request.first, request.limits);
  if (!first) return first.error();
  auto second = validation::read_planes(request.second, request.limits);
  if (!second) return second.error();
  const validation::Writer writer =
      second->writer != validation::Writer::unknown ? second->writer : first->writer;

  validation::CompareOptions options;
  options.tolerances = validation::tolerances_for(writer);
  for (const std::string& assignment : request.tolerances) {
    auto set = validation::override_tolerance(options.tolerances, assignment);
    if (!set) return set.error();
  }
  options.geometry = request.what != What::beauty;
  options.beauty = request.what != What::geometry;
  options.pictures = !request.report.empty();

  validation::Comparison comparison;
  comparison.scene = request.first;
  comparison.first = request.first;
  comparison.second = request.second;
  auto filled = validation::fill_comparison(comparison, first->planes, second->planes, options);
  if (!filled) {
    filled.error().file = request.first + ", " + request.second;
    return filled.error();
  }
  fmt::print("{}\n", validation::one_line(comparison));
  print_checks(comparison);

  const bool agree = comparison.status == validation::Status::agree;
  if (!request.report.empty()) {
    validation::Report report;
    report.title = "octrace compare";
    report.facts = {{"first", request.first},
                    {"second, the reference", request.second},
                    {"octrace", util::version()}};
    report.tolerances = {{validation::writer_name(writer), options.tolerances}};
    report.comparisons.push_back(std::move(comparison));
    auto written = validation::write_report(report, request.report);
    if (!written) return written.error();
  }
  return agree ? util::Exit::ok : util::Exit::different;
}

}  // namespace

void declare_compare(CLI::App& program, Run& chosen) {
  auto request = std::make_shared<CompareRequest>();
  CLI::App* command = program.add_subcommand(
      "compare", "compare two images: silhouettes, depths, object ids, beauty");
  command->footer(kHelp);
  command->add_option("A", request->first, "image")->required()->type_name("FILE");
  command->add_option("B", request->second, "image, the reference")->required()->type_name("FILE");
  command
      ->add_option("--report", request->report,
                   "write index.html and report.json to this folder, with pictures")
      ->type_name("DIR");
  command->add_option("--tolerance", request->tolerances, tolerance_help())
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
  add_choice<What>(*command, "--what", request->what,
                   {{"all", What::all}, {"geometry", What::geometry}, {"beauty", What::beauty}},
                   "which planes to compare [all that both have]");
  add_limit_options(*command, request->limits);
  add_verbosity_options(*command);
  command->callback([request, &chosen] { chosen = [request] { return run_compare(*request); }; });
}

}  // namespace octrace::app
