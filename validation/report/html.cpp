#include "validation/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "validation/report/page_assets.h"

namespace octrace::validation {
namespace {

std::string lower(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

std::string head(const Report& report, const Totals& sum) {
  const bool good = sum.differ == 0 && sum.errors == 0;
  std::string out =
      fmt::format(R"(<div class="verdict"><h1>{}</h1><span class="chip {}">{}</span></div>)",
                  escape_html(report.title),
                  good         ? "agree"
                  : sum.differ ? "differ"
                               : "error",
                  good         ? (sum.exceptions ? "all agree but the exceptions" : "all agree")
                  : sum.differ ? fmt::format("{} differ", sum.differ)
                               : fmt::format("{} could not be compared", sum.errors));
  const auto card = [&](const char* kind, std::size_t count, const char* what) {
    out += fmt::format(R"(<div class="card {}"><b>{}</b><span>{}</span></div>)", kind, count, what);
  };
  out += R"(<div class="cards">)";
  std::map<std::string, int> scenes;
  for (const Comparison& comparison : report.comparisons) ++scenes[comparison.scene];
  card("", scenes.size(), scenes.size() == 1 ? "scene" : "scenes");
  card("", sum.comparisons, sum.comparisons == 1 ? "comparison" : "comparisons");
  card(sum.agree ? "good" : "", sum.agree, "agree");
  card(sum.differ ? "bad" : "", sum.differ, "differ");
  card(sum.exceptions ? "odd" : "", sum.exceptions, "exceptions");
  card(sum.errors ? "gone" : "", sum.errors, "not compared");
  out += R"(</div><dl class="facts">)";
  for (const auto& [name, text] : report.facts) {
    out += fmt::format("<dt>{}</dt><dd>{}</dd>", escape_html(name), escape_html(text));
  }
  return out + "</dl>";
}

// One row for each program: how often, and how close at worst.
std::string program_table(const Report& report) {
  struct Row {
    Totals sum;
    std::uint64_t mask = 0, pixels = 0;
    double median = 0, p99 = 0;
  };
  std::map<std::string, Row> rows;
  for (const Comparison& c : report.comparisons) {
    Row& row = rows[c.second];
    ++row.sum.comparisons;
    row.sum.agree += c.status == Status::agree;
    row.sum.differ += c.status == Status::differ;
    row.sum.exceptions += c.status == Status::exception;
    row.sum.errors += c.status == Status::error;
    if (!c.geometry || c.status != Status::agree) continue;
    row.mask = std::max(row.mask, c.geometry->mask_total);
    row.median = std::max(row.median, c.geometry->depth_median);
    row.p99 = std::max(row.p99, c.geometry->depth_p99);
    row.pixels += c.geometry->covered_both;
  }
  std::string out =
      R"(<h2>By program</h2><div class="scroll" style="padding:8px 16px 12px"><table class="plain">)"
      R"(<tr><th>against</th><th class="n">comparisons</th><th class="n">agree</th><th class="n">)"
      R"(differ</th><th class="n">exceptions</th><th class="n">not compared</th><th class="n">pixels )"
      R"(compared</th><th class="n">largest mask difference, px</th><th class="n">largest depth )"
      R"(median</th><th class="n">largest depth p99</th></tr>)";
  for (const auto& [name, row] : rows) {
    out += fmt::format(
        R"(<tr><td>{}</td><td class="n">{}</td><td class="n">{}</td><td class="n">{}</td>)"
        R"(<td class="n">{}</td><td class="n">{}</td><td class="n">{}</td><td class="n">{}</td>)"
        R"(<td class="n">{}</td><td class="n">{}</td></tr>)",
        escape_html(name), row.sum.comparisons, row.sum.agree, row.sum.differ, row.sum.exceptions,
        row.sum.errors, row.pixels, row.mask, format_error(row.median), format_error(row.p99));
  }
  return out +
         R"(</table><div style="color:var(--soft);margin-top:8px">The four figures on the right )"
         R"(are of the comparisons that agree.</div></div>)";
}

// What did not agree, said before anybody has to look for it.
std::string attention(const Report& report) {
  std::string rows;
  for (std::size_t i = 0; i < report.comparisons.size(); ++i) {
    const Comparison& c = report.comparisons[i];
    if (c.status == Status::agree) continue;
    std::string why = escape_html(c.cause);
    for (const Check& check : c.checks) {
      if (check.passed()) continue;
      why += fmt::format("{}{} {} {} {}", why.empty() ? "" : "; ", check.name,
                         format_error(check.value), check.at_least ? "&lt;" : "&gt;",
                         format_error(check.limit));
    }
    rows += fmt::format(
        R"(<tr><td><span class="chip {0}">{0}</span></td><td><a href="#c{1}">{2}, {3}</a></td>)"
        R"(<td class="keep">{4}</td><td class="cause">{5}</td></tr>)",
        status_name(c.status), i, escape_html(c.scene), escape_html(c.camera),
        escape_html(c.second), why);
  }
  if (rows.empty()) return "";
  return R"(<details class="box" open><summary>What does not agree, and why</summary>)"
         R"(<div class="long"><table class="plain">)" +
         rows + "</table></div></details>";
}

std::string tolerance_table(const Report& report) {
  std::string out =
      R"(<details class="box"><summary>Tolerances and definitions</summary><table class="plain">)"
      R"(<tr><th>name</th>)";
  for (const auto& [name, unused] : report.tolerances) {
    out += fmt::format(R"(<th class="n">{}</th>)", escape_html(name));
  }
  out += "<th>meaning</th></tr>";
  for (const ToleranceField& field : kToleranceFields) {
    out += fmt::format("<tr><td>{}</td>", field.name);
    for (const auto& [unused, tolerances] : report.tolerances) {
      out += fmt::format(R"(<td class="n">{:g}</td>)", tolerances.*field.value);
    }
    out += fmt::format("<td>{}</td></tr>", field.description);
  }
  return out +
         fmt::format(
             "</table><p>Depth is planar, along the camera's axis. Errors are relative to the "
             "second image. The interior is every pixel that both images cover throughout its "
             "3x3 neighbourhood, without a depth jump of more than {:g} % in it. A mask pixel "
             "that differs is far from an edge where not both silhouettes have an edge in its "
             "3x3 neighbourhood.</p></details>",
             100 * kDepthJump);
}

std::string filters(const Report& report) {
  std::map<std::string, int> programs;
  for (const Comparison& comparison : report.comparisons) ++programs[comparison.second];
  std::string out =
      R"(<h2>Comparisons</h2><div class="filters"><input id="words" type="search" placeholder=)"
      R"("Scene or camera" aria-label="Scene or camera"><select id="program" aria-label="Program">)"
      R"(<option value="">all programs</option>)";
  for (const auto& [name, unused] : programs) {
    out += fmt::format("<option>{}</option>", escape_html(name));
  }
  out +=
      R"(</select><select id="status" aria-label="Result"><option value="">all results</option>)";
  for (const Status status : {Status::agree, Status::differ, Status::exception, Status::error}) {
    out += fmt::format("<option>{}</option>", status_name(status));
  }
  return out + R"(</select><span class="shown"></span></div>)";
}

struct Column {
  const char* title;
  const char* check;  // the tolerance that colours the cell; empty: none
};
constexpr Column kColumns[] = {
    {"mask px", "mask-total"},        {"far px", "mask-far"}, {"IoU", "iou"},
    {"depth median", "depth-median"}, {"p99", "depth-p99"},   {"max", ""},
    {"outliers", "outlier-count"},    {"ids", "id-share"},    {"covered", ""}};
constexpr Column kBeautyColumns[] = {{"RMSE", "rmse"}, {"FLIP", "flip"}};

std::string cell(const Comparison& comparison, const Column& column, double value,
                 const std::string& text) {
  bool over = false;
  for (const Check& check : comparison.checks) {
    over = over || (check.name == column.check && !check.passed());
  }
  return fmt::format(R"(<td data-v="{}"{}>{}</td>)", std::isfinite(value) ? value : 1e300,
                     over ? R"( class="over")" : "", text);
}

std::string cells(const Comparison& comparison, bool beauty_columns) {
  std::string out;
  if (comparison.geometry) {
    const GeometryMetrics& m = *comparison.geometry;
    const double values[] = {double(m.mask_total), double(m.mask_far),   m.iou,
                             m.depth_median,       m.depth_p99,          m.depth_max,
                             double(m.outliers),   double(m.ids_differ), double(m.covered_both)};
    for (std::size_t i = 0; i < std::size(kColumns); ++i) {
      const bool missing = (i >= 3 && i <= 6 && !m.has_depth) || (i == 7 && !m.has_ids);
      const std::string text = i == 2             ? fmt::format("{:.6f}", values[i])
                               : i >= 3 && i <= 5 ? format_error(values[i])
                                                  : fmt::format("{:.0f}", values[i]);
      out += missing ? "<td></td>" : cell(comparison, kColumns[i], values[i], text);
    }
  } else {
    for (std::size_t i = 0; i < std::size(kColumns); ++i) out += "<td></td>";
  }
  if (!beauty_columns) return out;
  if (!comparison.beauty) return out + "<td></td><td></td>";
  const double values[] = {comparison.beauty->rmse, comparison.beauty->flip_mean};
  for (std::size_t i = 0; i < 2; ++i) {
    out += cell(comparison, kBeautyColumns[i], values[i], fmt::format("{:.4f}", values[i]));
  }
  return out;
}

void append_table(std::string& out, const Report& report) {
  const bool beauty = std::any_of(report.comparisons.begin(), report.comparisons.end(),
                                  [](const Comparison& c) { return c.beauty.has_value(); });
  out +=
      R"(<div class="scroll"><table class="main"><thead><tr><th class="t">result</th><th class="t">)"
      R"(scene</th><th class="t">camera</th><th class="t">against</th>)";
  for (const Column& column : kColumns) out += fmt::format("<th>{}</th>", column.title);
  if (beauty) {
    for (const Column& column : kBeautyColumns) out += fmt::format("<th>{}</th>", column.title);
  }
  out += "</tr></thead>";
  const std::size_t columns =
      4 + std::size(kColumns) + (beauty ? std::size(kBeautyColumns) : std::size_t{0});
  for (std::size_t i = 0; i < report.comparisons.size(); ++i) {
    const Comparison& c = report.comparisons[i];
    const std::string scene = escape_html(c.scene), camera = escape_html(c.camera);
    const std::string program = escape_html(c.second);
    out += fmt::format(
        R"(<tbody id="c{0}" data-words="{1}" data-program="{2}" data-status="{3}"><tr class="row">)"
        R"(<td class="t" data-v="{3}"><span class="chip {3}">{3}</span></td>)"
        R"(<td class="t name" data-v="{4}">{4}</td><td class="t name" data-v="{5}">{5}</td>)"
        R"(<td class="t" data-v="{2}">{2}</td>)",
        i, lower(scene + " " + camera), program, status_name(c.status), scene, camera);
    out += cells(c, beauty);
    out += fmt::format(R"(</tr><tr class="detail"><td colspan="{}">)", columns);
    out += detail_html(c);
    out += "</td></tr></tbody>";
  }
  out += R"(</table><div class="none" hidden>Nothing matches.</div></div>)";
}

}  // namespace

std::string escape_html(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out.push_back(c);
    }
  }
  return out;
}

std::string format_error(double value) {
  if (value == 0.0) return "0";
  if (!std::isfinite(value)) return "inf";
  const bool whole = value == std::floor(value) && std::abs(value) < 1e9;
  if (whole) return fmt::format("{:.0f}", value);
  return std::abs(value) >= 1e-2 && std::abs(value) < 1e6 ? fmt::format("{:.4g}", value)
                                                          : fmt::format("{:.1e}", value);
}

std::string report_html(const Report& report) {
  const Totals sum = totals(report);
  std::string out = fmt::format(
      R"(<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content=)"
      R"("width=device-width"><title>{}</title><link rel="icon" href="data:,"><style>)",
      escape_html(report.title));
  out += kPageCss;
  out += "</style><script>";
  out += kPageJs;
  out += "</script></head><body><main>";
  out += head(report, sum);
  out += program_table(report);
  out += attention(report);
  out += tolerance_table(report);
  out += filters(report);
  append_table(out, report);
  return out + R"(</main><dialog><img alt="enlarged picture"></dialog></body></html>)"
               "\n";
}

}  // namespace octrace::validation
