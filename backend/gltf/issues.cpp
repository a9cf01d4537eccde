#include "backend/gltf/issues.h"

#include <fmt/format.h>

namespace octrace::gltf {

void Issues::fail(util::Exit exit, std::string_view code, std::string pointer,
                  std::string message) {
  if (error_) return;
  error_ = util::Error{exit, std::string(code), std::move(message), file_, std::move(pointer)};
}

void Issues::warn(std::string_view code, std::string pointer, std::string message) {
  if (warnings_.size() >= kMaxWarnings) {
    ++dropped_warnings_;
    return;
  }
  warnings_.push_back(
      util::Error{util::Exit::ok, std::string(code), std::move(message), file_, std::move(pointer)}
          .to_string());
}

std::vector<std::string> Issues::take_warnings() {
  if (dropped_warnings_ > 0) {
    warnings_.push_back(fmt::format("{}: {} more warnings", file_, dropped_warnings_));
  }
  return std::move(warnings_);
}

std::string quote(std::string_view text, std::size_t longest) {
  std::string out = "\"";
  for (const char c : text.substr(0, longest)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      out += fmt::format("\\x{:02x}", byte);
    } else {
      out += c;
    }
  }
  if (text.size() > longest) out += "...";
  return out + "\"";
}

std::string pointer_key(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace octrace::gltf
