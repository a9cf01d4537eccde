#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "validation/report/html.h"

namespace octrace::validation {
namespace {

std::string css_color(Rgb color) {
  return fmt::format("#{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
}

std::string gradient(Rgb (*color)(double)) {
  std::string stops;
  for (int i = 0; i <= 10; ++i) stops += "," + css_color(color(i / 10.0));
  return "background:linear-gradient(to right" + stops + ")";
}

std::string scale_bar(Rgb (*color)(double), const std::string& low, const std::string& high) {
  return fmt::format(R"(<div class="scale"><span>{}</span><i style="{}"></i><span>{}</span></div>)",
                     low, gradient(color), high);
}

std::string figure(const std::string& caption, const std::string& png, const Pictures& pictures,
                   const std::string& overlay, const std::string& below) {
  if (png.empty()) return "";
  return fmt::format(
      R"(<figure><figcaption>{}</figcaption><div class="frame"><img loading="lazy" )"
      R"(width="{}" height="{}" alt="{}" src="data:image/png;base64,{}">{}</div>{}</figure>)",
      caption, pictures.width, pictures.height, "picture", base64(png), overlay, below);
}

// A pixel of a picture that is shown at a third of its size is easily missed: ring it.
std::string rings(const Comparison& comparison, DisagreementKind kind, double least) {
  const GeometryMetrics& m = *comparison.geometry;
  std::string svg = fmt::format(R"(<svg viewBox="0 0 {} {}">)", m.width, m.height);
  bool any = false;
  for (const Disagreement& d : m.worst) {
    if (d.kind != kind || d.error < least) continue;
    any = true;
    svg += fmt::format(
        R"(<circle cx="{}" cy="{}" r="{:.1f}" fill="none" stroke="#ff4d6d" stroke-width="{:.1f}"/>)",
        d.x + 0.5, d.y + 0.5, std::max(4.0, m.width / 50.0), std::max(1.0, m.width / 250.0));
  }
  return any ? svg + "</svg>" : "";
}

std::string geometry_figures(const Comparison& c, const std::string& first,
                             const std::string& second) {
  const GeometryMetrics& m = *c.geometry;
  const Pictures& p = c.pictures;
  const auto silhouette = [&](const std::string& who, const std::string& png, std::uint64_t px) {
    return figure(fmt::format("<b>Silhouette</b> {}, {} px", who, px), png, p, "", "");
  };
  const std::string key = fmt::format(
      R"(<div class="key"><i style="background:{}"></i>both<i style="background:{}"></i>only {})"
      R"(<i style="background:{}"></i>only {}</div>)",
      css_color(kBoth), css_color(kOnlyA), first, css_color(kOnlyB), second);
  std::string out = silhouette(first, p.silhouette_a, m.covered_a) +
                    silhouette(second, p.silhouette_b, m.covered_b);
  out +=
      figure(fmt::format("<b>Difference</b> {} px, {} far from an edge", m.mask_total, m.mask_far),
             p.difference, p, rings(c, DisagreementKind::mask, 0.0), key);
  const std::string depths =
      scale_bar(depth_color, fmt::format("{:.5g}", p.near), fmt::format("{:.5g} m", p.far));
  out += figure("<b>Depth Z</b> " + first, p.depth_a, p, "", depths);
  out += figure("<b>Depth Z</b> " + second, p.depth_b, p, "", depths);
  out += figure("<b>Relative depth error</b> max " + format_error(m.depth_max) + " on the interior",
                p.depth_error, p, rings(c, DisagreementKind::depth, 1e-4),
                scale_bar(error_color, format_error(kErrorLow), format_error(kErrorHigh)));
  return out;
}

std::string checks_table(const Comparison& comparison) {
  std::string out =
      R"(<div><h3>Figures and tolerances</h3><table class="plain"><tr><th>check</th><th class="n">)"
      R"(found</th><th class="n">tolerance</th><th>verdict</th></tr>)";
  for (const Check& check : comparison.checks) {
    const bool precise = check.name == "iou";
    out += fmt::format(
        R"(<tr><td>{}</td><td class="n">{}</td><td class="n">{} {}</td><td class="{}">{}</td></tr>)",
        check.name, precise ? fmt::format("{:.6f}", check.value) : format_error(check.value),
        check.at_least ? "&ge;" : "&le;",
        precise ? fmt::format("{:g}", check.limit) : format_error(check.limit),
        check.passed() ? "within" : "over", check.passed() ? "within" : "beyond");
  }
  return out + "</table></div>";
}

std::string worst_table(const GeometryMetrics& metrics) {
  if (metrics.worst.empty()) return "";
  std::string out =
      R"(<div><h3>Largest disagreements</h3><table class="plain"><tr><th>of</th><th>pixel</th>)"
      R"(<th class="n">first</th><th class="n">second</th><th class="n">relative</th></tr>)";
  for (const Disagreement& d : metrics.worst) {
    const char* kind = d.kind == DisagreementKind::mask    ? "mask"
                       : d.kind == DisagreementKind::depth ? "depth"
                                                           : "object id";
    out += fmt::format(
        R"(<tr><td>{}</td><td>{}, {}</td><td class="n">{:.8g}</td><td class="n">{:.8g}</td>)"
        R"(<td class="n">{}</td></tr>)",
        kind, d.x, d.y, d.a, d.b,
        d.kind == DisagreementKind::depth ? format_error(d.error) : std::string());
  }
  return out + "</table></div>";
}

}  // namespace

std::string detail_html(const Comparison& comparison) {
  const std::string first = escape_html(comparison.first), second = escape_html(comparison.second);
  std::string out;
  if (!comparison.cause.empty()) {
    out += fmt::format(R"(<p class="cause"><span class="chip {0}">{0}</span> {1}</p>)",
                       status_name(comparison.status), escape_html(comparison.cause));
  }
  for (const std::string& note : comparison.notes) {
    out += fmt::format(R"(<p class="cause">{}</p>)", escape_html(note));
  }
  out += R"(<div class="pictures">)";
  if (comparison.geometry) out += geometry_figures(comparison, first, second);
  if (comparison.beauty) {
    const Pictures& p = comparison.pictures;
    out += figure("<b>Beauty</b> " + first, p.beauty_a, p, "", "");
    out += figure("<b>Beauty</b> " + second, p.beauty_b, p, "", "");
    out += figure(fmt::format("<b>FLIP</b> mean {:.4f}, max {:.3f}", comparison.beauty->flip_mean,
                              comparison.beauty->flip_max),
                  p.flip, p, "", scale_bar(error_color, "0", "1"));
  }
  out += R"(</div><div class="figures">)";
  if (comparison.geometry && comparison.geometry->has_depth && comparison.geometry->interior > 0) {
    out += "<div><h3>Depth errors</h3>" + histogram_svg(*comparison.geometry, comparison.checks) +
           "</div>";
  }
  if (!comparison.checks.empty()) out += checks_table(comparison);
  if (comparison.geometry) out += worst_table(*comparison.geometry);
  return out + "</div>";
}

}  // namespace octrace::validation
