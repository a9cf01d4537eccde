#include "backend/batch/json_list.h"

#include <fmt/format.h>

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

// Names come from files and need not be UTF-8.
std::string text_of(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace

util::Result<JsonListFile> JsonListFile::create(const std::string& path, const ordered_json& head,
                                                std::string_view list) {
  util::Result<util::OutputFile> file = util::OutputFile::create(path);
  if (!file) return file.error();
  JsonListFile out(std::move(*file));
  std::string text = "{\n";
  for (const auto& [key, value] : head.items()) {
    text += fmt::format("{}: {},\n", ordered_json(key).dump(), text_of(value));
  }
  text += fmt::format("\"{}\": [", list);
  if (auto ok = out.file_.append(text); !ok) return ok.error();
  return out;
}

util::Result<void> JsonListFile::add(const ordered_json& element) {
  if (auto ok = file_.append(first_ ? "\n" : ",\n"); !ok) return ok;
  first_ = false;
  return file_.append(text_of(element));
}

util::Result<void> JsonListFile::next_list(std::string_view name) {
  first_ = true;
  return file_.append(fmt::format("\n],\n\"{}\": [", name));
}

util::Result<void> JsonListFile::finish() {
  if (auto ok = file_.append("\n]\n}\n"); !ok) return ok;
  return file_.commit();
}

}  // namespace octrace::batch
