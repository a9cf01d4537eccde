// objects.json: the objects of each scene by id, and in which views they are seen, where and how
// large (docs/batch.md, "objects.json").
#pragma once

#include <map>

#include "backend/batch/json_list.h"

namespace octrace::batch {

// `scene` lines of journals by the scene's index.
using SceneLines = std::map<std::uint64_t, nlohmann::ordered_json>;

// From the `view` lines, in the order of add(); nothing of them is kept in memory. Errors of add():
// exit 3 where a line is none of a view.
class ObjectsFile {
 public:
  static util::Result<ObjectsFile> create(const std::string& path, const SceneLines& scenes);
  util::Result<void> add(const nlohmann::ordered_json& view_line);
  util::Result<void> finish() { return file_.finish(); }

 private:
  explicit ObjectsFile(JsonListFile file) : file_(std::move(file)) {}
  JsonListFile file_;
};

// The objects of a view: [{"object_id", "pixels", "bbox"}], and "rle" where the line has it.
util::Result<nlohmann::ordered_json> object_entries(const nlohmann::ordered_json& view_line);

// First column, first row, width, height, of a record's first and last column and row.
nlohmann::ordered_json coco_box(const nlohmann::ordered_json& box);

}  // namespace octrace::batch
