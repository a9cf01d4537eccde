// Names and paths come from files that anybody may have written: what reaches a generated program
// is reduced to what cannot end a comment, a string or an identifier.
#pragma once

#include <string>
#include <string_view>

namespace octrace::exporters {

// Letters, digits and underscores only, at most `most` characters; anything else becomes '_'.
std::string identifier(std::string_view name, std::size_t most = 24);

// Printable ASCII for a comment of one line, about 240 characters; the rest as \xNN.
std::string comment_text(std::string_view name);

// The path split for files written beside it: its folder ("" or ending in '/') and its name without
// the extension, reduced to letters, digits, '.', '-' and '_' where it names further files.
struct PathParts {
  std::string folder, name, stem, safe_stem;
};
PathParts path_parts(const std::string& path);

}  // namespace octrace::exporters
