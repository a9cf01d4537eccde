#include "backend/batch/annotations_file.h"

#include <fmt/format.h>

#include <fstream>
#include <set>

#include "backend/batch/run_length.h"
#include "backend/util/checked.h"
#include "backend/util/version.h"

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

util::Error invalid(const std::string& message) {
  return {util::Exit::invalid_input, "INVALID_RECORD", message, "", ""};
}

std::map<std::string, std::uint64_t> number_categories(const SceneLines& scenes) {
  std::set<std::string> names;
  for (const auto& [index, line] : scenes) {
    for (const ordered_json& object : line.at("objects")) names.insert(object.at("mesh"));
  }
  std::map<std::string, std::uint64_t> numbers;
  for (const std::string& name : names) numbers.emplace(name, numbers.size() + 1);
  return numbers;
}

}  // namespace

util::Result<AnnotationsFile> AnnotationsFile::create(const std::string& path,
                                                      const SceneLines& scenes, MaskCounts counts) {
  try {
    const auto categories = number_categories(scenes);
    ordered_json list = ordered_json::array();
    for (const auto& [name, number] : categories) {
      list.push_back({{"id", number}, {"name", name}, {"supercategory", "mesh"}});
    }
    util::Result<JsonListFile> file = JsonListFile::create(
        path,
        {{"info", {{"description", std::string("octrace ") + util::version()}, {"version", "1.0"}}},
         {"licenses", ordered_json::array()},
         {"categories", std::move(list)}},
        "images");
    if (!file) return file.error();
    util::Result<util::OutputFile> annotations = util::OutputFile::create(path + ".part");
    if (!annotations) return annotations.error();
    AnnotationsFile out(std::move(*file), std::move(*annotations), counts);
    for (const auto& [index, line] : scenes) {
      for (const ordered_json& object : line.at("objects")) {
        const std::string mesh = object.at("mesh");
        out.objects_[{index, object.at("id")}] = {categories.at(mesh), object.at("name")};
      }
    }
    return out;
  } catch (const ordered_json::exception& exception) {
    return invalid(exception.what());
  }
}

util::Result<void> AnnotationsFile::add(const ordered_json& view_line) {
  try {
    const std::uint64_t view = view_line.at("view"), scene = view_line.at("scene");
    const std::uint64_t width = view_line.at("size").at(0), height = view_line.at("size").at(1);
    const auto pixels = util::checked_mul(width, height);
    if (!pixels) return invalid(fmt::format("view {}: too many pixels", view));
    const ordered_json& files = view_line.at("files");
    auto added = file_.add({{"id", view},
                            {"width", width},
                            {"height", height},
                            {"file_name", files.empty() ? ordered_json("") : files[0].at("path")}});
    if (!added) return added;
    for (const ordered_json& object : view_line.at("objects")) {
      const std::string rle = object.at("rle");
      auto expanded = expand_counts(rle, *pixels);
      if (!expanded) return expanded.error();
      ordered_json counts = rle;
      if (counts_ == MaskCounts::uncompressed) counts = std::move(*expanded);
      const std::uint64_t id = object.at("id");
      const auto known = objects_.find({scene, id});
      if (known == objects_.end()) {
        return invalid(fmt::format("view {}: scene {} has no object {}", view, scene, id));
      }
      const ordered_json annotation = {
          {"id", next_id_},
          {"image_id", view},
          {"category_id", known->second.category},
          {"segmentation", {{"size", {height, width}}, {"counts", std::move(counts)}}},
          {"area", object.at("pixels")},
          {"bbox", coco_box(object.at("box"))},
          {"iscrowd", 0},
          {"object_id", id},
          {"object", known->second.name}};
      const std::string text =
          annotation.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
      if (auto ok = annotations_.append((next_id_ > 1 ? ",\n" : "\n") + text); !ok) return ok;
      ++next_id_;
    }
    return {};
  } catch (const ordered_json::exception& exception) {
    return invalid(exception.what());
  }
}

util::Result<void> AnnotationsFile::finish() {
  if (auto ok = file_.next_list("annotations"); !ok) return ok;
  if (auto ok = annotations_.flush(); !ok) return ok;
  std::ifstream in(annotations_.temporary(), std::ios::binary);
  std::string block(1 << 20, '\0');
  while (in) {
    in.read(block.data(), static_cast<std::streamsize>(block.size()));
    const auto count = static_cast<std::size_t>(in.gcount());
    if (count == 0) break;
    if (auto ok = file_.append(std::string_view(block).substr(0, count)); !ok) return ok;
  }
  if (in.bad()) {
    return util::Error{util::Exit::io, "IO_ERROR", "cannot be read back", annotations_.temporary(),
                       ""};
  }
  return file_.finish();
}

}  // namespace octrace::batch
