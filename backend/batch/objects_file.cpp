#include "backend/batch/objects_file.h"

#include "backend/util/version.h"

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

ordered_json conventions() {
  return {{"object_id", "as in the plane object_id: glTF node index + 1; 0 is the background"},
          {"bbox",
           "x, y, width, height in pixels; x, y: the first column and row, from 0 at the top left"},
          {"pixels", "whose centre shows the object; what other objects hide is not counted"}};
}

ordered_json scene_list(const SceneLines& scenes) {
  ordered_json list = ordered_json::array();
  for (const auto& [index, line] : scenes) {
    ordered_json objects = ordered_json::array();
    for (const ordered_json& object : line.at("objects")) {
      objects.push_back({{"object_id", object.at("id")},
                         {"name", object.at("name")},
                         {"mesh", object.at("mesh")},
                         {"materials", object.at("materials")}});
    }
    list.push_back({{"scene", line.at("name")},
                    {"source", line.at("source")},
                    {"objects", std::move(objects)}});
  }
  return list;
}

ordered_json object_entry(const ordered_json& object) {
  return {{"object_id", object.at("id")},
          {"pixels", object.at("pixels")},
          {"bbox", coco_box(object.at("box"))}};
}

util::Error invalid(const ordered_json::exception& exception) {
  return {util::Exit::invalid_input, "INVALID_RECORD", exception.what(), "", ""};
}

}  // namespace

ordered_json coco_box(const ordered_json& box) {
  const std::int64_t left = box.at(0), top = box.at(1), right = box.at(2), bottom = box.at(3);
  return {left, top, right - left + 1, bottom - top + 1};
}

util::Result<ordered_json> object_entries(const ordered_json& view_line) {
  try {
    ordered_json list = ordered_json::array();
    for (const ordered_json& object : view_line.at("objects")) {
      list.push_back(object_entry(object));
      if (object.contains("rle")) list.back()["rle"] = object["rle"];
    }
    return list;
  } catch (const ordered_json::exception& exception) {
    return invalid(exception);
  }
}

util::Result<ObjectsFile> ObjectsFile::create(const std::string& path, const SceneLines& scenes) {
  try {
    util::Result<JsonListFile> file = JsonListFile::create(path,
                                                           {{"octrace", util::version()},
                                                            {"conventions", conventions()},
                                                            {"scenes", scene_list(scenes)}},
                                                           "views");
    if (!file) return file.error();
    return ObjectsFile(std::move(*file));
  } catch (const ordered_json::exception& exception) {
    return invalid(exception);
  }
}

util::Result<void> ObjectsFile::add(const ordered_json& view_line) {
  try {
    ordered_json entry = {{"view", view_line.at("view")},
                          {"scene", view_line.at("name")},
                          {"camera", view_line.at("camera")},
                          {"frame", view_line.at("frame")},
                          {"objects", ordered_json::array()}};
    for (const ordered_json& object : view_line.at("objects")) {
      entry["objects"].push_back(object_entry(object));
    }
    return file_.add(entry);
  } catch (const ordered_json::exception& exception) {
    return invalid(exception);
  }
}

}  // namespace octrace::batch
