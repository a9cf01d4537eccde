#include "backend/batch/state.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <set>

#include "backend/batch/hash.h"
#include "backend/batch/journal.h"
#include "backend/util/atomic_file.h"

namespace octrace::batch {

namespace {

using nlohmann::ordered_json;
using util::Result;

constexpr std::size_t kChangesShown = 5;

std::string shown(const nlohmann::json& value) {
  std::string text = value.dump();
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

// "/size/0 was 640, is 320"
std::string changes(const ordered_json& before, const ordered_json& now) {
  const nlohmann::json was = before, is = now;  // sorted: the order of members means nothing
  const nlohmann::json patch = nlohmann::json::diff(was, is);
  std::string text;
  for (std::size_t i = 0; i < patch.size() && i < kChangesShown; ++i) {
    const std::string op = patch[i]["op"], path = patch[i]["path"];
    const nlohmann::json::json_pointer pointer(path);
    text += fmt::format("{}{}", i > 0 ? "; " : "", path);
    if (op == "add") {
      text += fmt::format(" is new: {}", shown(patch[i]["value"]));
    } else if (op == "remove") {
      text += fmt::format(" was {}, is gone", shown(was.at(pointer)));
    } else {
      text += fmt::format(" was {}, is {}", shown(was.at(pointer)), shown(patch[i]["value"]));
    }
  }
  if (patch.size() > kChangesShown) {
    text += fmt::format("; and {} more", patch.size() - kChangesShown);
  }
  return text;
}

bool same_job(const ordered_json& header, const ordered_json& meaning) {
  return nlohmann::json(header.at("job")) == nlohmann::json(meaning);
}

Result<void> check_header(const ordered_json& line, const ordered_json& meaning,
                          const std::string& path) {
  if (line.is_null() || line.at("kind") != "job") {
    return util::Error{util::Exit::io, "JOURNAL", "its first line is broken; --force starts anew",
                       path, ""};
  }
  if (same_job(line, meaning)) return {};
  return util::Error{
      util::Exit::usage, "JOB_CHANGED",
      fmt::format("the job is not the one that was begun in this folder: {} (--force starts anew)",
                  changes(line.at("job"), meaning)),
      path, ""};
}

bool files_are_there(const Plan& plan, std::uint64_t view, const ordered_json& line) {
  const std::vector<Output> files = plan.files(plan.view(view));
  const ordered_json& recorded = line.at("files");
  if (recorded.size() != files.size()) return false;
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(files[i].path, error);
    if (error || bytes != recorded[i].at("bytes").get<std::uint64_t>()) return false;
  }
  return true;
}

// A pack that lacks views is made again as a whole.
void note_pack(const Plan& plan, const ordered_json& line, Done& done) {
  if (!plan.job().pack || !line.at("failed").empty()) return;
  const auto index = line.at("pack").get<std::uint64_t>();
  if (index >= plan.packs()) return;
  const auto [begin, end] = plan.views_of_pack(index);
  if (begin < done.begin || end > done.begin + done.views.size() || done.has(begin)) return;
  std::error_code error;
  const auto bytes = std::filesystem::file_size(plan.pack_path(index), error);
  if (error || bytes != line.at("bytes").get<std::uint64_t>()) return;
  for (std::uint64_t view = begin; view < end; ++view) done.views[view - done.begin] = true;
  done.count += end - begin;
}

// The first line of a journal; null where it has none yet.
Result<ordered_json> read_header(const std::string& path) {
  ordered_json header;
  const util::Error found{util::Exit::ok, "", "", "", ""};
  auto text = read_journal(path, [&](const ordered_json& line) -> Result<void> {
    header = line;
    return found;  // one line is enough
  });
  if (!text && text.error().exit != util::Exit::ok) return text.error();
  return header;
}

// Temporary files of some outputs that nobody makes now, as the caller's lock ensures.
class Leftovers {
 public:
  void add(const std::string& path) {
    targets_.push_back(hash_text(path));
    std::string folder = path.substr(0, path.rfind('/') + 1);  // npos + 1 is 0: no folder
    if (folders_.empty() || *folders_.rbegin() != folder) folders_.insert(std::move(folder));
  }
  void add_results(const Plan& plan) {
    for (const char* name : {"summary.json", "cameras.json", "objects.json", "annotations.json"}) {
      add(plan.folder() + name);
    }
  }
  void remove() {
    std::sort(targets_.begin(), targets_.end());
    for (const std::string& folder : folders_) {
      std::error_code error;
      const std::string place = folder.empty() ? "." : folder;
      for (const auto& entry : std::filesystem::directory_iterator(place, error)) {
        const auto target = util::target_of_temporary(entry.path().filename().string());
        if (!target ||
            !std::binary_search(targets_.begin(), targets_.end(), hash_text(folder + *target))) {
          continue;
        }
        std::error_code ignored;
        std::filesystem::remove(entry.path(), ignored);
      }
    }
  }

 private:
  std::vector<std::uint64_t> targets_;  // hashes of their paths
  std::set<std::string> folders_;
};

}  // namespace

std::string state_folder(const std::string& output_folder) { return output_folder + ".octrace/"; }

std::string journal_path(const std::string& output_folder, const Shard& shard) {
  return fmt::format("{}journal-{}-of-{}.ndjson", state_folder(output_folder), shard.index,
                     shard.count);
}

std::string shard_summary_path(const std::string& output_folder, const Shard& shard) {
  return fmt::format("{}summary-{}-of-{}.json", state_folder(output_folder), shard.index,
                     shard.count);
}

std::vector<std::string> journals_in(const std::string& output_folder) {
  std::vector<std::string> paths;
  std::error_code error;
  const std::string folder = state_folder(output_folder);
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("journal-") && name.ends_with(".ndjson")) paths.push_back(folder + name);
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

Result<void> make_folder(const std::string& folder) {
  if (folder.empty()) return {};
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error || std::filesystem::is_directory(folder)) return {};
  return util::Error{util::Exit::io, "IO_ERROR",
                     fmt::format("the folder cannot be made: {}", error.message()), folder, ""};
}

Result<Done> read_done(const Plan& plan, const ordered_json& meaning, const Shard& shard) {
  const auto [begin, end] = plan.part(shard);
  Done done;
  done.begin = begin;
  done.views.resize(end - begin);
  done.scenes_described.resize(plan.job().scenes.size());
  const std::string own = journal_path(plan.folder(), shard);
  const std::string division = fmt::format("-of-{}.ndjson", shard.count);
  bool checked_a_neighbour = false;
  for (const std::string& path : journals_in(plan.folder())) {
    if (path != own && path.ends_with(division)) {
      if (checked_a_neighbour) continue;
      auto header = read_header(path);
      if (!header) return header.error();
      if (header->is_null()) continue;
      if (auto same = check_header(*header, meaning, path); !same) return same.error();
      checked_a_neighbour = true;
      continue;
    }
    bool first = true, ended = false;
    auto text = read_journal(path, [&](const ordered_json& line) -> Result<void> {
      if (first) {
        if (auto same = check_header(line, meaning, path); !same) return same;
        if (path == own) done.has_journal = true;
      }
      first = false;
      const std::string kind = line.at("kind");
      ended = kind == "end";
      if (kind == "scene" && path == own) {
        const auto scene = line.at("scene").get<std::size_t>();
        if (scene < done.scenes_described.size()) done.scenes_described[scene] = true;
      }
      if (kind == "pack") {
        note_pack(plan, line, done);
        return {};
      }
      if (kind != "view") return {};
      const auto view = line.at("view").get<std::uint64_t>();
      if (view >= begin && view < end && !done.has(view) && files_are_there(plan, view, line)) {
        done.views[view - begin] = true;
        ++done.count;
      }
      return {};
    });
    if (!text) return text.error();
    done.broken_lines += text->broken_lines;
    done.clean = done.clean && ended;
  }
  return done;
}

Result<void> check_same_job(const Plan& plan, const ordered_json& meaning) {
  for (const std::string& path : journals_in(plan.folder())) {
    auto header = read_header(path);
    if (!header) return header.error();
    if (header->is_null()) continue;
    if (auto same = check_header(*header, meaning, path); !same) return same;
  }
  return {};
}

Result<void> forget(const Plan& plan, const ordered_json& meaning, const Shard& shard) {
  const std::string own = journal_path(plan.folder(), shard);
  const std::string division = fmt::format("-of-{}.ndjson", shard.count);
  for (const std::string& path : journals_in(plan.folder())) {
    // Other shards of the same division may be running, or have run, beside this one.
    bool keep = path != own && path.ends_with(division);
    if (keep) {
      auto header = read_header(path);
      keep = header && (header->is_null() || check_header(*header, meaning, path));
    }
    if (!keep && ::unlink(path.c_str()) != 0) {
      return util::Error{util::Exit::io, "IO_ERROR",
                         fmt::format("cannot be removed: {}", std::strerror(errno)), path, ""};
    }
  }
  return {};
}

void remove_leftovers(const Plan& plan, const Shard& shard) {
  Leftovers leftovers;
  const auto [begin, end] = plan.part(shard);
  if (plan.job().pack && begin < end) {
    for (std::uint64_t i = plan.pack_of(begin); i <= plan.pack_of(end - 1); ++i) {
      leftovers.add(plan.pack_path(i));
    }
  } else {
    for (std::uint64_t index = begin; index < end; ++index) {
      for (const Output& file : plan.files(plan.view(index))) leftovers.add(file.path);
    }
  }
  leftovers.add(shard_summary_path(plan.folder(), shard));
  if (shard.count == 1) leftovers.add_results(plan);
  leftovers.remove();
}

void remove_result_leftovers(const Plan& plan) {
  Leftovers leftovers;
  leftovers.add_results(plan);
  leftovers.remove();
}

}  // namespace octrace::batch
