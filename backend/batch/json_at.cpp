#include "backend/batch/json_at.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "backend/gltf/files.h"
#include "backend/gltf/issues.h"
#include "backend/gltf/json_text.h"

namespace octrace::batch {

namespace {

std::string shortened(std::string text) {
  constexpr std::size_t kLongest = 80;
  if (text.size() <= kLongest) return text;
  std::size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;  // whole UTF-8
  return text.substr(0, end) + "...";
}

}  // namespace

util::Result<Json> read_json_file(const std::string& path, const util::Limits& limits,
                                  util::Exit wrong) {
  auto bytes = gltf::read_regular_file(path, limits.max_file_bytes);
  if (!bytes) {
    bytes.error().file = path;
    return bytes.error();
  }
  gltf::Issues issues(path);
  Json root = gltf::parse_json({reinterpret_cast<const char*>(bytes->data()), bytes->size()},
                               limits, issues);
  if (issues.failed()) {
    util::Error error = issues.take_error();
    if (error.exit == util::Exit::invalid_input) error.exit = wrong;
    return error;
  }
  return root;
}

JsonAt JsonAt::at(std::string_view key) const {
  JsonAt member = *this;
  member.value_ = &value_->at(std::string(key));
  member.pointer_ += '/' + gltf::pointer_key(key);
  return member;
}

JsonAt JsonAt::at(std::size_t index) const {
  JsonAt item = *this;
  item.value_ = &value_->at(index);
  item.pointer_ += fmt::format("/{}", index);
  return item;
}

util::Error JsonAt::error(std::string message) const {
  return {wrong_, "", std::move(message), *file_, pointer_};
}

util::Error JsonAt::needs(std::string_view what) const {
  return error(fmt::format("needs {}, got {}", what, shortened(value_->dump())));
}

util::Result<double> JsonAt::number(double least, double most) const {
  if (value_->is_number()) {
    const double number = value_->get<double>();
    if (number >= least && number <= most) return number;
  }
  return needs(fmt::format("a number from {:g} to {:g}", least, most));
}

util::Result<std::int64_t> JsonAt::integer(std::int64_t least, std::int64_t most) const {
  if (value_->is_number()) {
    const double number = value_->get<double>();  // 3.0 is an integer to JSON Schema too
    if (number == std::floor(number) && number >= static_cast<double>(least) &&
        number <= static_cast<double>(most)) {
      return static_cast<std::int64_t>(number);
    }
  }
  return needs(fmt::format("an integer from {} to {}", least, most));
}

util::Result<std::string> JsonAt::text() const {
  if (!value_->is_string()) return needs("a string");
  const auto& text = value_->get_ref<const std::string&>();
  const bool control =
      std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (text.empty() || control) return needs("a string that is not empty, of printable characters");
  return text;
}

util::Result<bool> JsonAt::boolean() const {
  if (!value_->is_boolean()) return needs("true or false");
  return value_->get<bool>();
}

util::Result<void> JsonAt::object(std::initializer_list<std::string_view> known,
                                  std::initializer_list<std::string_view> required) const {
  if (!value_->is_object()) return needs("an object");
  for (const auto& [key, value] : value_->items()) {
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      return at(key).error(fmt::format("unknown here; known are {}", fmt::join(known, ", ")));
    }
  }
  for (const std::string_view key : required) {
    if (!value_->contains(std::string(key))) return error(fmt::format("needs \"{}\"", key));
  }
  return {};
}

util::Result<std::size_t> JsonAt::array(std::size_t least, std::size_t most) const {
  if (!value_->is_array()) return needs("an array");
  if (value_->size() < least || value_->size() > most) {
    return error(least == most
                     ? fmt::format("needs {} items, got {}", least, value_->size())
                     : fmt::format("needs {} to {} items, got {}", least, most, value_->size()));
  }
  return value_->size();
}

}  // namespace octrace::batch
