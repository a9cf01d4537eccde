// Where in the journals of a folder the line of each view lies.
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "backend/util/result.h"

namespace octrace::batch {

class JournalIndex {
 public:
  explicit JournalIndex(std::uint64_t views) : places_(views) {}

  // Adds a journal's `view` lines; a later one of the same view takes the place of an earlier one
  // where accept(line) holds. Other lines go to visit(line). Torn and broken lines are counted.
  using Accept = std::function<bool(const nlohmann::ordered_json& line)>;
  using Visit = std::function<util::Result<void>(const nlohmann::ordered_json& line)>;
  util::Result<void> add(const std::string& path, const Accept& accept, const Visit& visit);

  bool has(std::uint64_t view) const { return places_[view].bytes > 0; }
  std::uint64_t broken_lines() const { return broken_lines_; }
  util::Result<nlohmann::ordered_json> line(std::uint64_t view);

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::uint32_t journal = 0, bytes = 0;
  };
  std::vector<Place> places_;  // by view
  std::vector<std::string> journals_;
  std::uint64_t broken_lines_ = 0;
  // The journal read last: views of a shard follow one another.
  int open_journal_ = -1;
  std::shared_ptr<std::FILE> file_;
};

}  // namespace octrace::batch
