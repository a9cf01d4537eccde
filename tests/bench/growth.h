// How the time of a ray and of a build grows with a scene: rows of one terrain at several sizes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace octrace::bench {

// Sorts the rows by size and adds to those of rays (with "set"; others are builds), per set:
//   time_per_log        nanoseconds a ray over log2(triangles)
//   time_per_log_step   the same over that of the size before: above 1, time grows faster than log
//   n work_per_log_step   the same of nodes and triangles visited, which no cache changes
void add_growth(nlohmann::json& rows);

// A line a size and set, and what octrace and its peer did from the smallest size to the largest.
std::string growth_report(const nlohmann::json& rows);

// Mrays/s and build times against triangles.
std::string growth_svg(const nlohmann::json& rows, const std::string& note);

}  // namespace octrace::bench
