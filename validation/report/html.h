// Pieces of the report's page.
#pragma once

#include <string>
#include <string_view>

#include "validation/report/report.h"

namespace octrace::validation {

std::string escape_html(std::string_view text);
std::string format_error(double value);  // "3.1e-08", "0", "inf"

// Bars of the interior's relative depth errors, with the tolerances drawn across.
std::string histogram_svg(const GeometryMetrics& metrics, const std::vector<Check>& checks);

// The row that opens below a comparison: pictures, histogram, figures, largest disagreements.
std::string detail_html(const Comparison& comparison);

}  // namespace octrace::validation
