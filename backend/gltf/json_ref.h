// A place in a JSON tree of which nothing is known yet: every reader checks the type and the range
// and reports a Khronos code with the place's JSON pointer.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "backend/gltf/json_text.h"

namespace octrace::gltf {

// Holds pointers to its parents, so that a JSON pointer is only written when it is needed: a parent
// must outlive its children, which is why members of temporaries are refused.
class JsonRef {
 public:
  JsonRef(Json& root, Issues& issues) : json_(&root), issues_(&issues) {}

  explicit operator bool() const { return json_ != nullptr; }
  Json& json() const { return *json_; }
  Issues& issues() const { return *issues_; }
  std::string pointer() const;

  // A member of an object. Absent members are empty refs, which every reader passes over.
  JsonRef member(std::string_view key) const&;
  JsonRef member(std::string_view key) && = delete;
  JsonRef required(std::string_view key) const&;  // reports UNDEFINED_PROPERTY
  JsonRef required(std::string_view key) && = delete;
  JsonRef element(std::size_t i) const&;
  JsonRef element(std::size_t i) && = delete;
  // fn(std::string_view key, const JsonRef&) for each member, fn(std::size_t, const JsonRef&) for
  // each element, until something has failed.
  template <class Fn>
  void each_member(Fn fn) const& {
    if (!json_ || !json_->is_object()) return;
    for (auto it = json_->begin(); it != json_->end() && !issues_->failed(); ++it) {
      fn(std::string_view(it.key()), JsonRef(&it.value(), issues_, this, it.key(), 0));
    }
  }
  template <class Fn>
  void each_element(Fn fn) const& {
    if (!json_ || !json_->is_array()) return;
    for (std::size_t i = 0; i < json_->size() && !issues_->failed(); ++i) fn(i, element(i));
  }

  // Type checks: *this, or an empty ref after TYPE_MISMATCH or EMPTY_ENTITY.
  JsonRef as_object() const;
  JsonRef as_array() const;  // with at least one element
  std::optional<std::string_view> as_string() const;
  std::optional<bool> as_boolean() const;
  // glTF allows 3.0 where an integer is wanted (as the Khronos validator does); the tree is then
  // changed to 3, which is what tinygltf needs.
  std::optional<std::int64_t> as_integer(std::int64_t lowest, std::int64_t highest) const;
  // An index into an array of `size`; -1 where absent or wrong.
  int as_index(std::size_t size, std::string_view what) const;
  // Also checks that the number can be a float, since that is what all of them become.
  std::optional<double> as_number(double lowest = -std::numeric_limits<float>::max(),
                                  double highest = std::numeric_limits<float>::max()) const;
  // An array of exactly `count` numbers.
  bool as_numbers(std::size_t count, double lowest = -std::numeric_limits<float>::max(),
                  double highest = std::numeric_limits<float>::max()) const;
  // VALUE_NOT_IN_LIST unless the value is one of these.
  std::optional<std::string_view> as_one_of(std::span<const std::string_view> allowed) const;
  std::optional<std::int64_t> as_one_of(std::span<const std::int64_t> allowed) const;

  void invalid(std::string_view code, std::string message) const {
    if (!issues_->failed()) issues_->invalid(code, pointer(), std::move(message));
  }

 private:
  JsonRef(Json* json, Issues* issues, const JsonRef* parent, std::string_view key,
          std::size_t index)
      : json_(json), issues_(issues), parent_(parent), key_(key), index_(index) {}
  void mismatch(std::string_view wanted) const;

  Json* json_ = nullptr;
  Issues* issues_ = nullptr;
  const JsonRef* parent_ = nullptr;
  std::string_view key_;   // within an object; data() is null within an array
  std::size_t index_ = 0;  // within an array
};

}  // namespace octrace::gltf
