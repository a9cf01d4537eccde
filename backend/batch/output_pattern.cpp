#include "backend/batch/output_pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

namespace octrace::batch {

namespace {

constexpr std::size_t kLongestName = 100;  // of the 255 bytes of a file's name
constexpr int kWidestNumber = 20;

// Bytes of the UTF-8 character that starts here; 0: none does (RFC 3629).
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  if (lead == 0xe0 && byte(1) < 0xa0) return 0;  // longer than it must be
  if (lead == 0xed && byte(1) > 0x9f) return 0;  // half of a surrogate pair
  if (lead == 0xf0 && byte(1) < 0x90) return 0;
  if (lead == 0xf4 && byte(1) > 0x8f) return 0;  // beyond U+10FFFF
  if (lead == 0xc2 && byte(1) < 0xa0) return 0;  // control characters
  return length;
}

bool harmless(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '_' || c == '.' || c == '+';
}

}  // namespace

std::string path_name(std::string_view name) {
  std::string out;
  for (std::size_t i = 0; i < name.size();) {
    const std::size_t length = utf8_length(name.substr(i));
    const std::size_t taken = std::max<std::size_t>(length, 1);
    if (out.size() + taken > kLongestName) break;
    if (length > 1 || (length == 1 && harmless(name[i]))) {
      out += name.substr(i, taken);
    } else {
      out += '_';
    }
    i += taken;
  }
  if (out.starts_with('.')) out.front() = '_';
  if (out.empty()) out = '_';
  return out;
}

util::Result<OutputPattern::Piece> OutputPattern::parse_field(std::string_view text) {
  struct Name {
    std::string_view name;
    Field field;
    bool number;
  };
  static constexpr std::array<Name, 8> kNames = {{{"scene", Field::scene, false},
                                                  {"camera", Field::camera, false},
                                                  {"frame", Field::frame, true},
                                                  {"view", Field::view, true},
                                                  {"scene_index", Field::scene_index, true},
                                                  {"camera_index", Field::camera_index, true},
                                                  {"aov", Field::aov, false},
                                                  {"pack", Field::pack, true}}};
  const auto wrong = [&](std::string_view what) {
    return util::Error{util::Exit::usage, "", fmt::format("{{{}}}: {}", text, what), "", ""};
  };
  const std::size_t colon = text.find(':');
  const std::string_view field = text.substr(0, colon);
  const std::size_t slash = field.find('/');
  const auto* found = std::find_if(kNames.begin(), kNames.end(), [&](const Name& name) {
    return name.name == field.substr(0, slash);
  });
  if (found == kNames.end()) {
    return wrong(
        "there is no such field; there are {scene}, {camera}, {frame}, {view}, {scene_index}, "
        "{camera_index} and {aov}; {{ is a brace");
  }
  Piece piece{found->field, "", 0, 1};
  if (slash != std::string_view::npos) {
    const std::string_view divisor = field.substr(slash + 1);
    const char* end = divisor.data() + divisor.size();
    const auto [stop, error] = std::from_chars(divisor.data(), end, piece.divisor);
    if (!found->number || error != std::errc() || stop != end || piece.divisor < 1) {
      return wrong(found->number ? "needs a whole number after /, as in {view/1000}"
                                 : "is a name, which cannot be divided");
    }
  }
  if (colon == std::string_view::npos) return piece;
  const std::string_view width = text.substr(colon + 1);
  const char* end = width.data() + width.size();
  if (found->number && width.starts_with('0')) {
    const auto [stop, error] = std::from_chars(width.data(), end, piece.width);
    if (error == std::errc() && stop == end && piece.width >= 1 && piece.width <= kWidestNumber) {
      return piece;
    }
  }
  return wrong(found->number ? "needs :0N, with N from 1 to 20 digits, as in {frame:04}"
                             : "is a name, which takes no format");
}

util::Result<OutputPattern> OutputPattern::parse(std::string_view text) {
  OutputPattern pattern;
  pattern.text_ = text;
  std::string literal;
  const auto end_literal = [&] {
    if (!literal.empty()) pattern.pieces_.push_back({Field::literal, literal, 0, 1});
    literal.clear();
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if ((c == '{' || c == '}') && i + 1 < text.size() && text[i + 1] == c) {
      literal += c;
      ++i;
    } else if (c == '}') {
      return util::Error{util::Exit::usage, "", "a } without a {; }} is a brace", "", ""};
    } else if (c == '{') {
      const std::size_t close = text.find('}', i);
      if (close == std::string_view::npos) {
        return util::Error{util::Exit::usage, "", "a { without a }; {{ is a brace", "", ""};
      }
      end_literal();
      auto piece = parse_field(text.substr(i + 1, close - i - 1));
      if (!piece) return piece.error();
      pattern.pieces_.push_back(std::move(*piece));
      i = close;
    } else {
      literal += c;
    }
  }
  end_literal();
  return pattern;
}

std::string OutputPattern::path(const PathFields& fields) const {
  std::string path;
  for (const Piece& piece : pieces_) path += OutputPattern::path(piece, fields);
  return path;
}

std::string OutputPattern::path(const Piece& piece, const PathFields& fields) {
  const auto number = [&](std::uint64_t value) {
    return fmt::format("{:0{}}", static_cast<std::int64_t>(value) / piece.divisor, piece.width);
  };
  switch (piece.field) {
    case Field::literal:
      return piece.literal;
    case Field::scene:
      return fields.scene;
    case Field::camera:
      return fields.camera;
    case Field::aov:
      return fields.aov;
    case Field::frame:
      return number(static_cast<std::uint64_t>(fields.frame));
    case Field::view:
      return number(fields.view);
    case Field::scene_index:
      return number(fields.scene_index);
    case Field::camera_index:
      return number(fields.camera_index);
    case Field::pack:
      return number(fields.pack);
  }
  return {};
}

bool OutputPattern::has(Field field) const {
  return std::any_of(pieces_.begin(), pieces_.end(),
                     [&](const Piece& piece) { return piece.field == field; });
}

std::string OutputPattern::folder() const {
  if (pieces_.empty() || pieces_.front().field != Field::literal) return "";
  const std::string& literal = pieces_.front().literal;
  const std::size_t slash = literal.rfind('/');
  return slash == std::string::npos ? "" : literal.substr(0, slash + 1);
}

std::string_view OutputPattern::tail() const {
  if (pieces_.empty() || pieces_.back().field != Field::literal) return {};
  return pieces_.back().literal;
}

}  // namespace octrace::batch
