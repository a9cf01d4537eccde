#include "exporters/text.h"

#include <fmt/format.h>

namespace octrace::exporters {

namespace {

// Not std::isalnum, which asks the locale.
bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

}  // namespace

std::string identifier(std::string_view name, std::size_t most) {
  std::string text(name.substr(0, most));
  for (char& c : text) {
    if (!is_word(c)) c = '_';
  }
  return text;
}

std::string comment_text(std::string_view name) {
  constexpr std::size_t kMost = 240;
  std::string text;
  for (const char c : name) {
    if (text.size() >= kMost) return text + "...";
    if (c >= 0x20 && c < 0x7f && c != '\\' && c != '*') {
      text += c;
    } else {
      text += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  return text;
}

PathParts path_parts(const std::string& path) {
  PathParts parts;
  const std::size_t slash = path.rfind('/');
  parts.folder = slash == std::string::npos ? "" : path.substr(0, slash + 1);
  parts.name = path.substr(parts.folder.size());
  const std::size_t dot = parts.name.rfind('.');
  parts.stem = dot == std::string::npos || dot == 0 ? parts.name : parts.name.substr(0, dot);
  parts.safe_stem = parts.stem;
  for (char& c : parts.safe_stem) {
    if (!is_word(c) && c != '.' && c != '-') c = '_';
  }
  return parts;
}

}  // namespace octrace::exporters
