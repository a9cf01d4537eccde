#include "validation/compare/tolerances.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace octrace::validation {

util::Result<void> override_tolerance(Tolerances& tolerances, std::string_view assignment) {
  const auto fail = [&](std::string message) {
    return util::Error{util::Exit::usage, "",
                       fmt::format("--tolerance {}: {}", assignment, message), "", ""};
  };
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) return fail("needs the form NAME=VALUE");
  const std::string_view name = assignment.substr(0, equals);
  const std::string_view text = assignment.substr(equals + 1);
  double value = 0.0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value) ||
      value < 0.0) {
    return fail("the value must be a number that is not negative");
  }
  std::string names;
  for (const ToleranceField& field : kToleranceFields) {
    if (field.name == name) {
      tolerances.*field.value = value;
      return {};
    }
    names += fmt::format("{}{}", names.empty() ? "" : ", ", field.name);
  }
  return fail(fmt::format("there is no such tolerance; they are {}", names));
}

}  // namespace octrace::validation
