// Views as members of tar files instead of files of their own: a pack holds a fixed number of views
// that follow one another, in their order, and appears when the last of them is made
// (docs/batch.md, "Packs").
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "backend/batch/plan.h"
#include "backend/batch/tar_file.h"

namespace octrace::batch {

struct PackMember {
  std::string name, content;
};

class PackWriter {
 public:
  // `note` writes a line into the journal.
  using Note = std::function<util::Result<void>(const nlohmann::ordered_json& line)>;
  PackWriter(const Plan& plan, Note note) : plan_(plan), note_(std::move(note)) {}

  // From any thread, in any order, each view once. Views that come early wait in memory.
  util::Result<void> add(std::uint64_t view, std::vector<PackMember> members);
  util::Result<void> skip(std::uint64_t view);  // it failed: its pack will lack it

  std::uint64_t done() const;  // views in the packs that are whole; those of others are lost

 private:
  struct Pack {
    std::optional<TarFile> file;  // none before the first member
    std::uint64_t next = 0, made = 0;
    std::map<std::uint64_t, std::optional<std::vector<PackMember>>> waiting;  // nothing: failed
    nlohmann::ordered_json failed = nlohmann::ordered_json::array();
  };
  util::Result<void> take(std::uint64_t view, std::optional<std::vector<PackMember>> members);
  util::Result<void> append(std::uint64_t index, Pack& pack,
                            const std::vector<PackMember>& members);
  util::Result<void> finish(std::uint64_t index, Pack& pack);

  const Plan& plan_;
  const Note note_;
  mutable std::mutex mutex_;
  std::uint64_t done_ = 0;
  std::map<std::uint64_t, Pack> open_;  // by number
};

// The member that describes a view, NAME.json beside its first file NAME.exr: its entry of
// cameras.json, and of objects.json where the job asks for objects.
util::Result<PackMember> pack_description(const nlohmann::ordered_json& view_line);

}  // namespace octrace::batch
