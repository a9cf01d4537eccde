// Collects binary data and the JSON records that describe it, and lays both out as a .glb.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::exporters {

class GlbBuilder {
 public:
  enum class Target { none, vertices, indices };

  nlohmann::ordered_json& json() { return json_; }

  // Each returns the new entry's index.
  int add_view(std::span<const std::uint8_t> bytes, Target target);
  // `components` floats an element; `bounds`: with min and max, which POSITION must have.
  int add_floats(std::span<const float> values, int components, bool bounds);
  int add_indices(std::span<const std::uint32_t> indices, std::uint32_t vertex_count);
  template <class Record>
  int add(const char* list, Record record) {
    json_[list].push_back(std::move(record));
    return static_cast<int>(json_[list].size()) - 1;
  }
  void use_extension(const std::string& name);

  // Fails (exit 4) beyond the 4 GiB that a .glb's 32-bit lengths can say.
  util::Result<std::string> finish(const std::string& path);

 private:
  nlohmann::ordered_json json_;
  std::string binary_;
};

}  // namespace octrace::exporters
