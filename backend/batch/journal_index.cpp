#include "backend/batch/journal_index.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

namespace octrace::batch {

using nlohmann::ordered_json;

namespace {

util::Error cannot_read(const std::string& path) {
  return {util::Exit::io, "IO_ERROR", fmt::format("cannot be read: {}", std::strerror(errno)), path,
          ""};
}

util::Error not_ours(const std::string& path, std::uint64_t line, const char* why) {
  return {util::Exit::io, "JOURNAL",
          fmt::format("line {} is not one of this program's: {}", line, why), path, ""};
}

}  // namespace

util::Result<void> JournalIndex::add(const std::string& path, const Accept& accept,
                                     const Visit& visit) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return cannot_read(path);
  const auto journal = static_cast<std::uint32_t>(journals_.size());
  journals_.push_back(path);
  std::uint64_t offset = 0, number = 0;
  for (std::string text; std::getline(file, text);) {
    if (file.eof()) break;  // no line break: torn
    ++number;
    const std::uint64_t begin = offset;
    offset += text.size() + 1;
    const ordered_json line = ordered_json::parse(text, nullptr, false);
    if (!line.is_object() || text.size() > 0xffffffffu) {
      ++broken_lines_;
      continue;
    }
    try {
      if (line.at("kind") != "view") {
        if (auto ok = visit(line); !ok) return ok;
        continue;
      }
      const auto view = line.at("view").get<std::uint64_t>();
      if (view >= places_.size() || !accept(line)) continue;
      places_[view] = {begin, journal, static_cast<std::uint32_t>(text.size())};
    } catch (const ordered_json::exception& exception) {
      return not_ours(path, number, exception.what());
    }
  }
  if (file.bad()) return cannot_read(path);
  return {};
}

util::Result<ordered_json> JournalIndex::line(std::uint64_t view) {
  const Place& place = places_[view];
  const std::string& path = journals_[place.journal];
  if (open_journal_ != static_cast<int>(place.journal)) {
    file_.reset(std::fopen(path.c_str(), "rbe"), [](std::FILE* f) {
      if (f != nullptr) std::fclose(f);
    });
    open_journal_ = static_cast<int>(place.journal);
  }
  std::string text(place.bytes, '\0');
  if (!file_ || ::fseeko(file_.get(), static_cast<off_t>(place.offset), SEEK_SET) != 0 ||
      std::fread(text.data(), 1, text.size(), file_.get()) != text.size()) {
    return cannot_read(path);
  }
  ordered_json line = ordered_json::parse(text, nullptr, false);
  if (!line.is_object()) {
    return util::Error{util::Exit::io, "JOURNAL", "changed while it was read", path, ""};
  }
  return line;
}

}  // namespace octrace::batch
