// A JSON object whose last member is a list too long to hold in memory: an element a line.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "backend/util/output_file.h"

namespace octrace::batch {

class JsonListFile {
 public:
  // {HEAD's members, "NAME": [ELEMENTS]}
  static util::Result<JsonListFile> create(const std::string& path,
                                           const nlohmann::ordered_json& head,
                                           std::string_view list);
  util::Result<void> add(const nlohmann::ordered_json& element);
  // A second list after the first.
  util::Result<void> next_list(std::string_view name);
  util::Result<void> append(std::string_view text) { return file_.append(text); }  // as it is
  util::Result<void> finish();

 private:
  explicit JsonListFile(util::OutputFile file) : file_(std::move(file)) {}
  util::OutputFile file_;
  bool first_ = true;
};

}  // namespace octrace::batch
