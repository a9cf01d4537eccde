#include "backend/gltf/uri.h"

#include <fmt/format.h>

#include <array>
#include <optional>

#include "backend/gltf/issues.h"

namespace octrace::gltf {
namespace {

util::Error bad(std::string_view code, std::string message) {
  return {util::Exit::invalid_input, std::string(code), std::move(message), "", ""};
}

bool is_alpha(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

int hex_value(char c) {
  if (is_digit(c)) return c - '0';
  if (lower(c) >= 'a' && lower(c) <= 'f') return lower(c) - 'a' + 10;
  return -1;
}

std::optional<std::string> percent_decoded(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    if (text.size() - i < 3) return std::nullopt;
    const int high = hex_value(text[i + 1]), low = hex_value(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    out += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return out;
}

constexpr std::uint8_t kNotBase64 = 0xff;

constexpr std::array<std::uint8_t, 256> make_base64_values() {
  constexpr std::string_view alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::uint8_t, 256> values{};
  for (auto& value : values) value = kNotBase64;
  for (std::size_t i = 0; i < alphabet.size(); ++i) {
    values[static_cast<unsigned char>(alphabet[i])] = static_cast<std::uint8_t>(i);
  }
  return values;
}
constexpr auto kBase64Values = make_base64_values();

// RFC 4648 section 4, with its padding.
std::optional<std::vector<std::uint8_t>> base64_decoded(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  std::vector<std::uint8_t> out;
  out.reserve(text.size() / 4 * 3);
  for (std::size_t i = 0; i < text.size(); i += 4) {
    const bool last = i + 4 == text.size();
    std::uint32_t bits = 0;
    std::uint8_t wrong = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const bool padded = last && k + padding >= 4;
      const std::uint8_t value =
          padded ? 0 : kBase64Values[static_cast<unsigned char>(text[i + k])];
      wrong |= value & 0xc0;
      bits = bits << 6 | (value & 0x3f);
    }
    if (wrong) return std::nullopt;
    out.push_back(static_cast<std::uint8_t>(bits >> 16));
    out.push_back(static_cast<std::uint8_t>(bits >> 8));
    out.push_back(static_cast<std::uint8_t>(bits));
  }
  out.resize(out.size() - padding);
  return out;
}

// RFC 2045 section 5.1.
bool is_token(std::string_view text) {
  if (text.empty()) return false;
  for (const char c : text) {
    if (c <= ' ' || c == 0x7f || static_cast<unsigned char>(c) >= 0x80) return false;
    if (std::string_view("()<>@,;:\\\"/[]?=").find(c) != std::string_view::npos) return false;
  }
  return true;
}

// type/subtype;attribute=value;...
bool is_media_type(std::string_view text) {
  bool first = true;
  while (true) {
    const std::size_t end = text.find(';');
    const std::string_view part = text.substr(0, end);
    const std::size_t middle = part.find(first ? '/' : '=');
    if (middle == std::string_view::npos) return false;
    if (!is_token(part.substr(0, middle)) || !is_token(part.substr(middle + 1))) return false;
    if (end == std::string_view::npos) return true;
    text.remove_prefix(end + 1);
    first = false;
  }
}

bool has_scheme(std::string_view uri) {
  const std::size_t colon = uri.find_first_of(":/?#");
  if (colon == std::string_view::npos || uri[colon] != ':' || colon == 0) return false;
  if (!is_alpha(uri[0])) return false;
  for (const char c : uri.substr(0, colon)) {
    if (!is_alpha(c) && !is_digit(c) && c != '+' && c != '-' && c != '.') return false;
  }
  return true;
}

}  // namespace

bool is_data_uri(std::string_view uri) {
  constexpr std::string_view scheme = "data:";
  if (uri.size() < scheme.size()) return false;
  for (std::size_t i = 0; i < scheme.size(); ++i) {
    if (lower(uri[i]) != scheme[i]) return false;
  }
  return true;
}

util::Result<DataUri> decode_data_uri(std::string_view uri) {
  uri.remove_prefix(std::string_view("data:").size());
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) {
    return bad("INVALID_URI", "a data URI needs a comma before its data");
  }
  std::string_view header = uri.substr(0, comma);
  const std::string_view body = uri.substr(comma + 1);
  constexpr std::string_view marker = ";base64";
  const bool base64 = header.ends_with(marker);
  if (base64) header.remove_suffix(marker.size());
  DataUri data;
  // RFC 2397 lets the type itself be left out but not its parameters' names.
  if (!header.empty()) {
    if (!is_media_type(header.starts_with(';') ? "text/plain" + std::string(header)
                                               : std::string(header))) {
      return bad("INVALID_URI", fmt::format("not a media type: {}", quote(header)));
    }
    for (const char c : header.substr(0, header.find(';'))) data.mime += lower(c);
  }
  const bool escaped = body.find('%') != std::string_view::npos;
  std::string unescaped;
  if (escaped) {
    auto decoded = percent_decoded(body);
    if (!decoded) return bad("INVALID_URI", "a data URI with a broken percent escape");
    unescaped = std::move(*decoded);
  }
  const std::string_view plain = escaped ? std::string_view(unescaped) : body;
  if (base64) {
    auto bytes = base64_decoded(plain);
    if (!bytes) {
      return bad("INVALID_URI",
                 fmt::format("a data URI whose {} characters are not base64", plain.size()));
    }
    data.bytes = std::move(*bytes);
  } else {
    data.bytes.assign(plain.begin(), plain.end());
  }
  return data;
}

util::Result<std::string> relative_path(std::string_view uri) {
  if (uri.empty()) return bad("INVALID_URI", "the URI is empty");
  if (has_scheme(uri)) {
    return bad("NON_RELATIVE_URI",
               fmt::format("needs a path relative to the scene, has {}", quote(uri)));
  }
  const auto decoded = percent_decoded(uri);
  if (!decoded) {
    return bad("INVALID_URI", fmt::format("a broken percent escape in {}", quote(uri)));
  }
  if (decoded->empty() || decoded->front() == '/') {
    return bad("NON_RELATIVE_URI",
               fmt::format("needs a path relative to the scene, has {}", quote(uri)));
  }
  for (const char c : *decoded) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      return bad("INVALID_URI", fmt::format("a control character in {}", quote(uri)));
    }
  }
  std::vector<std::string_view> parts;
  std::string_view rest = *decoded;
  while (!rest.empty()) {
    const std::size_t end = rest.find('/');
    const std::string_view part = rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    if (part.empty() || part == ".") continue;
    if (part != "..") {
      parts.push_back(part);
    } else if (!parts.empty()) {
      parts.pop_back();
    } else {
      return bad("INVALID_URI", fmt::format("{} leaves the scene's folder", quote(uri)));
    }
  }
  if (parts.empty()) {
    return bad("INVALID_URI", fmt::format("{} names a folder, needs a file", quote(uri)));
  }
  return fmt::format("{}", fmt::join(parts, "/"));
}

}  // namespace octrace::gltf
