// Errors as values: every stage returns Result<T>, and the program turns an Error into one line on
// standard error and an exit code. Exceptions are left to std::bad_alloc and to bugs.
#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace octrace::util {

// The process's exit codes, a promise to scripts: never renumber.
enum class Exit : int {
  ok = 0,
  different = 1,      // two images were compared and differ
  usage = 2,          // wrong command line
  invalid_input = 3,  // a file breaks its format's rules
  unsupported = 4,    // a valid file needs what octrace (or this machine) does not have
  io = 5,             // reading or writing failed
  limit = 6,          // a named limit, or memory
  internal = 7,       // a bug in octrace
  partial = 8,        // some jobs of a batch failed
};

struct Error {
  Exit exit = Exit::internal;
  std::string code;     // the Khronos validator's code where it has one, e.g. ACCESSOR_TOO_LONG
  std::string message;  // what was needed and what was there
  std::string file;     // as the user named it; may be empty
  std::string pointer;  // RFC 6901 JSON pointer into file; may be empty

  // "scene.gltf#/accessors/3: ACCESSOR_TOO_LONG: needs 4800 bytes, bufferView 2 has 4096"
  std::string to_string() const {
    std::string text = file;
    if (!pointer.empty()) text += "#" + pointer;
    if (!text.empty()) text += ": ";
    if (!code.empty()) text += code + ": ";
    return text + message;
  }
};

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT: implicit

  explicit operator bool() const { return state_.index() == 0; }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(value()); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  T& value() {
    assert(state_.index() == 0);
    return std::get<0>(state_);
  }
  const T& value() const { return std::get<0>(state_); }
  Error& error() { return std::get<1>(state_); }
  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)), ok_(false) {}  // NOLINT: implicit

  explicit operator bool() const { return ok_; }
  Error& error() { return error_; }
  const Error& error() const { return error_; }

 private:
  Error error_;
  bool ok_ = true;
};

}  // namespace octrace::util
