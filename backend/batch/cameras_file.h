// cameras.json: where each view was taken from and how it projects, for computer vision
// (docs/batch.md, "cameras.json").
#pragma once

#include "backend/batch/json_list.h"

namespace octrace::batch {

// From the `view` lines of journals, in the order of add(); nothing of them is kept in memory.
class CamerasFile {
 public:
  static util::Result<CamerasFile> create(const std::string& path);
  util::Result<void> add(const nlohmann::ordered_json& view_line);
  util::Result<void> finish() { return file_.finish(); }

 private:
  explicit CamerasFile(JsonListFile file) : file_(std::move(file)) {}
  JsonListFile file_;
};

// One element of its `views`; exit 3 where the line is none of a view.
util::Result<nlohmann::ordered_json> camera_entry(const nlohmann::ordered_json& view_line);

}  // namespace octrace::batch
