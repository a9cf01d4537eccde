#include "backend/batch/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace octrace::batch {

namespace {

util::Error io_error(const std::string& file, std::string_view what, int error_number) {
  return {util::Exit::io, "IO_ERROR", fmt::format("{}: {}", what, std::strerror(error_number)),
          file, ""};
}

// Bytes up to the end of the last line that has one; -1: errno says why not.
off_t whole_lines(int descriptor) {
  std::array<char, 1 << 16> block{};
  off_t end = ::lseek(descriptor, 0, SEEK_END);
  while (end > 0) {
    const off_t begin = std::max<off_t>(0, end - static_cast<off_t>(block.size()));
    const ssize_t got =
        ::pread(descriptor, block.data(), static_cast<std::size_t>(end - begin), begin);
    if (got < 0) return -1;
    const std::string_view text(block.data(), static_cast<std::size_t>(got));
    const std::size_t line = text.rfind('\n');
    if (line != std::string_view::npos) return begin + static_cast<off_t>(line) + 1;
    end = begin;
  }
  return end;
}

}  // namespace

util::Result<Journal> Journal::open(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (descriptor < 0) return io_error(path, "cannot be opened", errno);
  Journal journal(path, descriptor, 0);
  const off_t bytes = whole_lines(descriptor);
  if (bytes < 0) return io_error(path, "cannot be read", errno);
  if (::ftruncate(descriptor, bytes) != 0) {
    return io_error(path, "cannot be cut to its last whole line", errno);
  }
  journal.bytes_ = static_cast<std::uint64_t>(bytes);
  return journal;
}

Journal::Journal(Journal&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      bytes_(other.bytes_) {}

Journal::~Journal() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

util::Result<void> Journal::append(std::string_view json) {
  std::string line(json);
  line += '\n';
  ssize_t written = 0;
  do {
    written = ::write(descriptor_, line.data(), line.size());
  } while (written < 0 && errno == EINTR);
  if (written == static_cast<ssize_t>(line.size())) {
    bytes_ += line.size();
    return {};
  }
  // A part of a line means that there was no room for the rest.
  const int error_number = written < 0 ? errno : ENOSPC;
  if (written > 0 && ::ftruncate(descriptor_, static_cast<off_t>(bytes_)) != 0) {
    return io_error(path_, "a line cannot be taken back", errno);
  }
  return io_error(path_, "cannot be written", error_number);
}

util::Result<void> Journal::flush() {
  if (::fdatasync(descriptor_) != 0) return io_error(path_, "cannot be flushed", errno);
  return {};
}

util::Result<JournalText> read_journal(
    const std::string& path,
    const std::function<util::Result<void>(const nlohmann::ordered_json& line)>& visit) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return io_error(path, "cannot be read", errno);
  JournalText text;
  for (std::string line; std::getline(file, line);) {
    if (file.eof()) break;  // no line break: torn
    text.whole_bytes += line.size() + 1;
    const nlohmann::ordered_json json = nlohmann::ordered_json::parse(line, nullptr, false);
    if (!json.is_object()) {
      ++text.broken_lines;
      continue;
    }
    ++text.lines;
    try {
      if (util::Result<void> visited = visit(json); !visited) return visited.error();
    } catch (const nlohmann::json::exception& exception) {
      return util::Error{util::Exit::io, "JOURNAL",
                         fmt::format("line {} is not one of this program's: {}",
                                     text.lines + text.broken_lines, exception.what()),
                         path, ""};
    }
  }
  if (file.bad()) return io_error(path, "cannot be read", errno);
  return text;
}

}  // namespace octrace::batch
