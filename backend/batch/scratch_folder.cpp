#include "backend/batch/scratch_folder.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

namespace octrace::batch {

namespace {

util::Error io_error(const std::string& path, std::string_view what) {
  return {util::Exit::io, "IO_ERROR", fmt::format("{}: {}", what, std::strerror(errno)), path, ""};
}

}  // namespace

util::Result<ScratchFolder> ScratchFolder::create() {
  std::error_code error;
  const std::filesystem::path place = std::filesystem::temp_directory_path(error);
  std::string path = (error ? "/tmp" : place) / "octrace-XXXXXX";
  if (::mkdtemp(path.data()) == nullptr) return io_error(path, "the folder cannot be made");
  return ScratchFolder(path + "/");
}

ScratchFolder::ScratchFolder(ScratchFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

util::Result<std::string> take_file(const std::string& path) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  std::string content(error ? 0 : bytes, '\0');
  if (error || !file.read(content.data(), static_cast<std::streamsize>(bytes))) {
    return io_error(path, "cannot be read");
  }
  std::filesystem::remove(path, error);
  return content;
}

}  // namespace octrace::batch
