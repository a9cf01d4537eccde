#include "backend/gltf/json_ref.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace octrace::gltf {
namespace {

std::string shown(const Json& json) {
  if (json.is_string()) return quote(json.get_ref<const std::string&>());
  if (json.is_structured()) return fmt::format("{} of {}", json.type_name(), json.size());
  return json.dump();
}

}  // namespace

std::string JsonRef::pointer() const {
  if (!parent_) return "";
  return parent_->pointer() + "/" + (key_.data() ? pointer_key(key_) : std::to_string(index_));
}

JsonRef JsonRef::member(std::string_view key) const& {
  if (json_ && json_->is_object()) {
    const auto it = json_->find(key);
    if (it != json_->end()) return JsonRef(&it.value(), issues_, this, it.key(), 0);
  }
  return JsonRef(nullptr, issues_, this, key, 0);
}

JsonRef JsonRef::required(std::string_view key) const& {
  JsonRef found = member(key);
  if (!found && json_ && !issues_->failed()) {
    issues_->invalid("UNDEFINED_PROPERTY", pointer(), fmt::format("needs {}", quote(key)));
  }
  return found;
}

JsonRef JsonRef::element(std::size_t i) const& {
  return JsonRef(&(*json_)[i], issues_, this, std::string_view(), i);
}

void JsonRef::mismatch(std::string_view wanted) const {
  if (parent_ && !key_.data()) {
    parent_->invalid("ARRAY_TYPE_MISMATCH", fmt::format("element {} needs to be {}, is {}", index_,
                                                        wanted, shown(*json_)));
    return;
  }
  invalid("TYPE_MISMATCH", fmt::format("needs {}, has {}", wanted, shown(*json_)));
}

JsonRef JsonRef::as_object() const {
  if (!json_ || json_->is_object()) return *this;
  mismatch("an object");
  return JsonRef(nullptr, issues_, parent_, key_, index_);
}

JsonRef JsonRef::as_array() const {
  if (!json_ || (json_->is_array() && !json_->empty())) return *this;
  if (json_->is_array()) {
    invalid("EMPTY_ENTITY", "needs at least one element");
  } else {
    mismatch("an array");
  }
  return JsonRef(nullptr, issues_, parent_, key_, index_);
}

std::optional<std::string_view> JsonRef::as_string() const {
  if (!json_) return std::nullopt;
  if (json_->is_string()) return std::string_view(json_->get_ref<const std::string&>());
  mismatch("a string");
  return std::nullopt;
}

std::optional<bool> JsonRef::as_boolean() const {
  if (!json_) return std::nullopt;
  if (json_->is_boolean()) return json_->get_ref<const bool&>();
  mismatch("true or false");
  return std::nullopt;
}

std::optional<std::int64_t> JsonRef::as_integer(std::int64_t lowest, std::int64_t highest) const {
  if (!json_) return std::nullopt;
  constexpr double kExact = 9007199254740992.0;  // 2^53: beyond it a double skips integers
  if (json_->is_number_float()) {
    const double value = *json_->get_ptr<const Json::number_float_t*>();
    if (value != std::trunc(value) || std::abs(value) > kExact) {
      mismatch("an integer");
      return std::nullopt;
    }
    const auto whole = static_cast<std::int64_t>(value);
    if (whole >= 0) {
      *json_ = static_cast<std::uint64_t>(whole);
    } else {
      *json_ = whole;
    }
  }
  if (!json_->is_number_integer()) {
    mismatch("an integer");
    return std::nullopt;
  }
  std::int64_t value = 0;
  bool in_range = true;
  if (const auto* big = json_->get_ptr<const Json::number_unsigned_t*>()) {
    in_range = *big <= static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    value = in_range ? static_cast<std::int64_t>(*big) : 0;
  } else {
    value = *json_->get_ptr<const Json::number_integer_t*>();
  }
  if (!in_range || value < lowest || value > highest) {
    invalid("VALUE_NOT_IN_RANGE",
            fmt::format("needs {} to {}, has {}", lowest, highest, shown(*json_)));
    return std::nullopt;
  }
  return value;
}

int JsonRef::as_index(std::size_t size, std::string_view what) const {
  if (!json_) return -1;
  if (json_->is_number() && json_->is_number_integer() && !json_->is_number_unsigned() &&
      *json_->get_ptr<const Json::number_integer_t*>() < 0) {
    invalid("INVALID_INDEX", fmt::format("an index cannot be {}", shown(*json_)));
    return -1;
  }
  // However large, a reference beyond the array is unresolved rather than out of range.
  const auto end = std::min<std::size_t>(size, std::numeric_limits<int>::max());
  const auto value = as_number(0, std::numeric_limits<double>::max());
  if (!value) return -1;
  if (*value >= static_cast<double>(end)) {
    invalid("UNRESOLVED_REFERENCE",
            fmt::format("needs {} {}, the file has {}", what, shown(*json_), size));
    return -1;
  }
  const auto index = as_integer(0, std::numeric_limits<int>::max());
  return index ? static_cast<int>(*index) : -1;
}

std::optional<double> JsonRef::as_number(double lowest, double highest) const {
  if (!json_) return std::nullopt;
  if (!json_->is_number()) {
    mismatch("a number");
    return std::nullopt;
  }
  double value = 0;
  if (const auto* real = json_->get_ptr<const Json::number_float_t*>()) {
    value = *real;
  } else if (const auto* big = json_->get_ptr<const Json::number_unsigned_t*>()) {
    value = static_cast<double>(*big);
  } else {
    value = static_cast<double>(*json_->get_ptr<const Json::number_integer_t*>());
  }
  if (!(value >= lowest && value <= highest)) {
    invalid("VALUE_NOT_IN_RANGE",
            fmt::format("needs {} to {}, has {}", lowest, highest, shown(*json_)));
    return std::nullopt;
  }
  // tinygltf keeps integers of extensions as int, so larger ones would wrap.
  if (json_->is_number_integer() && std::abs(value) > std::numeric_limits<int>::max()) {
    *json_ = value;
  }
  return value;
}

bool JsonRef::as_numbers(std::size_t count, double lowest, double highest) const {
  const JsonRef array = as_array();
  if (!array) return false;
  if (array.json().size() != count) {
    invalid("ARRAY_LENGTH_NOT_IN_LIST",
            fmt::format("needs {} numbers, has {}", count, array.json().size()));
    return false;
  }
  bool good = true;
  for (std::size_t i = 0; i < count && good; ++i) {
    good = element(i).as_number(lowest, highest).has_value();
  }
  return good;
}

std::optional<std::string_view> JsonRef::as_one_of(
    std::span<const std::string_view> allowed) const {
  const auto value = as_string();
  if (!value || std::find(allowed.begin(), allowed.end(), *value) != allowed.end()) return value;
  invalid("VALUE_NOT_IN_LIST",
          fmt::format("needs one of {}, has {}", fmt::join(allowed, ", "), quote(*value)));
  return std::nullopt;
}

std::optional<std::int64_t> JsonRef::as_one_of(std::span<const std::int64_t> allowed) const {
  const auto value = as_integer(std::numeric_limits<std::int64_t>::min(),
                                std::numeric_limits<std::int64_t>::max());
  if (!value || std::find(allowed.begin(), allowed.end(), *value) != allowed.end()) return value;
  invalid("VALUE_NOT_IN_LIST",
          fmt::format("needs one of {}, has {}", fmt::join(allowed, ", "), *value));
  return std::nullopt;
}

}  // namespace octrace::gltf
