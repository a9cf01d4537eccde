// A value of a JSON file that came from outside, and where it stands: checks that name the place by
// its RFC 6901 pointer, what was needed and what was there.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "backend/util/limits.h"
#include "backend/util/result.h"

namespace octrace::batch {

using Json = nlohmann::json;

// An object at the top. Exit 5 where the file cannot be read, 6 beyond limits, `wrong` where it is
// no JSON.
util::Result<Json> read_json_file(const std::string& path, const util::Limits& limits,
                                  util::Exit wrong);

class JsonAt {
 public:
  // `wrong` is the exit code of everything that is wrong with this file.
  JsonAt(const Json& root, const std::string& file, util::Exit wrong)
      : value_(&root), file_(&file), wrong_(wrong) {}

  const Json& value() const { return *value_; }
  const std::string& pointer() const { return pointer_; }
  bool has(const char* key) const { return value_->is_object() && value_->contains(key); }
  JsonAt at(std::string_view key) const;  // must be there
  JsonAt at(std::size_t index) const;

  util::Error error(std::string message) const;
  util::Error needs(std::string_view what) const;  // "needs WHAT, got 12"

  // Each is an error where the value is of another type or beyond the bounds, both inclusive.
  util::Result<double> number(double least, double most) const;
  util::Result<std::int64_t> integer(std::int64_t least, std::int64_t most) const;
  util::Result<std::string> text() const;  // not empty, no control characters
  util::Result<bool> boolean() const;
  util::Result<void> object(std::initializer_list<std::string_view> known,
                            std::initializer_list<std::string_view> required) const;
  util::Result<std::size_t> array(std::size_t least, std::size_t most) const;

 private:
  const Json* value_;
  const std::string* file_;
  std::string pointer_;
  util::Exit wrong_;
};

// Reads a member where it is there, and leaves `into` as it is where not.
template <class T, class Read>
util::Result<void> read_member(const JsonAt& object, const char* key, T& into, const Read& read) {
  if (!object.has(key)) return {};
  auto value = read(object.at(key));
  if (!value) return value.error();
  into = static_cast<T>(std::move(*value));
  return {};
}

}  // namespace octrace::batch
