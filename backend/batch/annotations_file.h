// annotations.json: instance masks of every view as COCO's run lengths, for pycocotools and what
// reads its files (docs/batch.md, "annotations.json").
#pragma once

#include <optional>

#include "backend/batch/json_list.h"
#include "backend/batch/objects_file.h"

namespace octrace::batch {

enum class MaskCounts { compressed, uncompressed };

// An image a view, whose id is the view's number; an annotation an object of a view; a category a
// mesh, numbered from 1 by name over all scenes. From the `view` lines, in the order of add();
// nothing of them is kept in memory. Errors of add(): exit 3 where a line is none of a view with
// masks.
class AnnotationsFile {
 public:
  static util::Result<AnnotationsFile> create(const std::string& path, const SceneLines& scenes,
                                              MaskCounts counts);
  util::Result<void> add(const nlohmann::ordered_json& view_line);
  util::Result<void> finish();

 private:
  // Both lists grow at once: annotations wait in a file of their own that never gets its name.
  AnnotationsFile(JsonListFile file, util::OutputFile annotations, MaskCounts counts)
      : file_(std::move(file)), annotations_(std::move(annotations)), counts_(counts) {}

  struct Object {
    std::uint64_t category = 0;
    std::string name;
  };
  using ObjectKey = std::pair<std::uint64_t, std::uint64_t>;  // scene's index, object's id

  JsonListFile file_;
  util::OutputFile annotations_;
  MaskCounts counts_;
  std::map<ObjectKey, Object> objects_;
  std::uint64_t next_id_ = 1;  // pycocotools takes 0 for "none"
};

}  // namespace octrace::batch
