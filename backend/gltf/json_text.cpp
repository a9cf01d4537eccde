#include "backend/gltf/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace octrace::gltf {
namespace {

// Copying, writing and tinygltf's reading of a tree recurse, up to some kilobytes of stack a level,
// so an 8 MiB stack bears this many whatever the option says.
constexpr std::uint64_t kStackDepth = 1024;

// Deepest nesting of brackets outside strings. Wrong syntax is left to the parser, which does not
// recurse.
std::uint64_t nesting_depth(std::string_view text) {
  std::uint64_t depth = 0, deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_string = false;
      }
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      deepest = std::max(deepest, ++depth);
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return deepest;
}

// nlohmann's message, without its own error number.
std::string_view reason(std::string_view what) {
  const auto end = what.find("] ");
  return end == std::string_view::npos ? what : what.substr(end + 2);
}

}  // namespace

Json parse_json(std::string_view text, const util::Limits& limits, Issues& issues) {
  // tinygltf takes the length as an unsigned int.
  const std::uint64_t longest =
      std::min<std::uint64_t>(limits.max_json_bytes, std::numeric_limits<std::int32_t>::max());
  if (text.size() > longest) {
    issues.fail(
        util::Exit::limit, "LIMIT", "",
        fmt::format("the JSON has {} bytes, --max-json-bytes allows {}", text.size(), longest));
    return Json::object();
  }
  const std::uint64_t deepest = std::min(limits.max_json_depth, kStackDepth);
  if (const std::uint64_t depth = nesting_depth(text); depth > deepest) {
    issues.fail(
        util::Exit::limit, "LIMIT", "",
        fmt::format("the JSON is nested {} deep, --max-json-depth allows {}", depth, deepest));
    return Json::object();
  }
  // The parser takes a zero byte for the end of its input, whatever stands behind it.
  if (const auto zero = text.find('\0'); zero != std::string_view::npos) {
    issues.invalid("INVALID_JSON", "", fmt::format("a zero byte at {}", zero));
    return Json::object();
  }
  try {
    Json root = Json::parse(text.begin(), text.end());
    if (root.is_object()) return root;
    issues.invalid("INVALID_JSON", "",
                   fmt::format("needs an object at the top, has a{} {}", root.is_array() ? "n" : "",
                               root.type_name()));
  } catch (const Json::exception& e) {
    issues.invalid("INVALID_JSON", "", quote(reason(e.what()), 240));
  }
  return Json::object();
}

}  // namespace octrace::gltf
