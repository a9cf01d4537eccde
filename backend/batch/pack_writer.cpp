#include "backend/batch/pack_writer.h"

#include "backend/batch/cameras_file.h"
#include "backend/batch/objects_file.h"
#include "backend/batch/state.h"

namespace octrace::batch {

using nlohmann::ordered_json;
using util::Result;

Result<void> PackWriter::add(std::uint64_t view, std::vector<PackMember> members) {
  return take(view, std::move(members));
}

Result<void> PackWriter::skip(std::uint64_t view) { return take(view, std::nullopt); }

std::uint64_t PackWriter::done() const {
  const std::lock_guard lock(mutex_);
  return done_;
}

Result<void> PackWriter::take(std::uint64_t view, std::optional<std::vector<PackMember>> members) {
  const std::lock_guard lock(mutex_);
  const std::uint64_t index = plan_.pack_of(view);
  const auto [begin, end] = plan_.views_of_pack(index);
  const auto [at, is_new] = open_.try_emplace(index);
  Pack& pack = at->second;
  if (is_new) pack.next = begin;
  pack.waiting.emplace(view, std::move(members));
  for (auto first = pack.waiting.begin(); first != pack.waiting.end() && first->first == pack.next;
       first = pack.waiting.erase(first), ++pack.next) {
    if (!first->second) {
      pack.failed.push_back(first->first);
      continue;
    }
    if (auto ok = append(index, pack, *first->second); !ok) return ok;
    ++pack.made;
  }
  if (pack.next < end) return {};
  if (auto finished = finish(index, pack); !finished) return finished;
  done_ += pack.made;
  open_.erase(at);
  return {};
}

Result<void> PackWriter::append(std::uint64_t index, Pack& pack,
                                const std::vector<PackMember>& members) {
  if (!pack.file) {
    const std::string path = plan_.pack_path(index);
    if (auto made = make_folder(path.substr(0, path.rfind('/') + 1)); !made) return made;
    auto file = TarFile::create(path);
    if (!file) return file.error();
    pack.file.emplace(std::move(*file));
  }
  for (const PackMember& member : members) {
    if (auto ok = pack.file->add(member.name, member.content); !ok) return ok;
  }
  return {};
}

Result<void> PackWriter::finish(std::uint64_t index, Pack& pack) {
  if (!pack.file) return {};  // all of its views failed
  auto bytes = pack.file->commit();
  if (!bytes) return bytes.error();
  const auto [begin, end] = plan_.views_of_pack(index);
  return note_({{"kind", "pack"},
                {"pack", index},
                {"views", {begin, end - 1}},
                {"failed", std::move(pack.failed)},
                {"path", plan_.pack_path(index).substr(plan_.folder().size())},
                {"bytes", *bytes}});
}

Result<PackMember> pack_description(const ordered_json& view_line) {
  auto entry = camera_entry(view_line);
  if (!entry) return entry.error();
  if (view_line.contains("objects")) {
    auto objects = object_entries(view_line);
    if (!objects) return objects.error();
    (*entry)["objects"] = std::move(*objects);
  }
  const std::string first = view_line.at("files").at(0).at("path");
  return PackMember{first.substr(0, first.rfind('.')) + ".json",
                    entry->dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n"};
}

}  // namespace octrace::batch
