// Messages to people, on standard error. Results go to standard output.
#pragma once

#include <string_view>

namespace octrace::util {

enum class Verbosity { quiet, normal, verbose };

void set_verbosity(Verbosity verbosity);
Verbosity verbosity();

void log_error(std::string_view message);    // always
void log_warning(std::string_view message);  // unless quiet; the same text only once
void log_info(std::string_view message);     // unless quiet
void log_verbose(std::string_view message);  // only when verbose

}  // namespace octrace::util
