// What validation found: the first error stops the load, warnings are collected.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::gltf {

class Issues {
 public:
  explicit Issues(std::string file) : file_(std::move(file)) {}

  // Readers go on with harmless defaults after a failure, so that code may look at failed() once a
  // loop instead of after each value; only the first failure is kept.
  bool failed() const { return error_.has_value(); }
  void fail(util::Exit exit, std::string_view code, std::string pointer, std::string message);
  void invalid(std::string_view code, std::string pointer, std::string message) {
    fail(util::Exit::invalid_input, code, std::move(pointer), std::move(message));
  }
  // Beyond kMaxWarnings only their number is kept.
  void warn(std::string_view code, std::string pointer, std::string message);

  const std::string& file() const { return file_; }
  util::Error take_error() { return std::move(*error_); }
  std::vector<std::string> take_warnings();

 private:
  static constexpr std::size_t kMaxWarnings = 100;
  std::string file_;
  std::optional<util::Error> error_;
  std::vector<std::string> warnings_;
  std::size_t dropped_warnings_ = 0;
};

// A text from the file as it may be printed: control characters escaped, long ones cut.
std::string quote(std::string_view text, std::size_t longest = 80);

// A member's name as it stands in a JSON pointer (RFC 6901, section 3).
std::string pointer_key(std::string_view key);

}  // namespace octrace::gltf
