// What a batch has done, as lines of JSON that only ever grow (docs/batch.md, "Journal lines").
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "backend/util/result.h"

namespace octrace::batch {

class Journal {
 public:
  // Creates the file where it is missing, and cuts off a last line that was not written whole.
  // Exit 5 where it cannot be opened.
  static util::Result<Journal> open(const std::string& path);
  Journal(Journal&& other) noexcept;
  Journal& operator=(Journal&&) = delete;
  ~Journal();

  // One line with one write(); `json` holds no line break. Where the disk is full (exit 5) nothing
  // of it stays behind.
  util::Result<void> append(std::string_view json);
  util::Result<void> flush();  // returns when what was appended is on disk

 private:
  Journal(std::string path, int descriptor, std::uint64_t bytes)
      : path_(std::move(path)), descriptor_(descriptor), bytes_(bytes) {}
  std::string path_;
  int descriptor_ = -1;
  std::uint64_t bytes_ = 0;
};

struct JournalText {
  std::uint64_t lines = 0;         // whole ones, as visited
  std::uint64_t broken_lines = 0;  // not JSON: a power cut may leave such; what they told is lost
  std::uint64_t whole_bytes = 0;   // up to the end of the last line that has one
};

// Visits every whole line in order. A torn last line and broken ones are left out. Exit 5 where the
// file cannot be read; an error of `visit` ends the reading and is returned.
util::Result<JournalText> read_journal(
    const std::string& path,
    const std::function<util::Result<void>(const nlohmann::ordered_json& line)>& visit);

}  // namespace octrace::batch
