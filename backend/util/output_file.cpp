#include "backend/util/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace octrace::util {

namespace {

constexpr std::size_t kBuffer = 1 << 20;

Error io_error(const std::string& file, std::string_view what) {
  return {Exit::io, "IO_ERROR", fmt::format("{}: {}", what, std::strerror(errno)), file, ""};
}

}  // namespace

Result<OutputFile> OutputFile::create(const std::string& target) {
  Result<AtomicFile> file = AtomicFile::create(target);
  if (!file) return file.error();
  const int descriptor = ::open(file->temporary().c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  if (descriptor < 0) return io_error(target, "cannot be opened");
  return OutputFile(std::move(*file), target, descriptor);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : file_(std::move(other.file_)),
      target_(std::move(other.target_)),
      buffer_(std::move(other.buffer_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      written_(other.written_) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<void> OutputFile::append(std::string_view bytes) {
  if (buffer_.size() + bytes.size() <= kBuffer) {
    buffer_.append(bytes);
    return {};
  }
  if (Result<void> flushed = flush(); !flushed) return flushed;
  if (bytes.size() <= kBuffer) {
    buffer_.append(bytes);
    return {};
  }
  if (Result<void> written = write_at(written_, bytes); !written) return written;
  written_ += bytes.size();
  return {};
}

Result<void> OutputFile::patch(std::uint64_t offset, std::string_view bytes) {
  if (Result<void> flushed = flush(); !flushed) return flushed;
  if (offset > written_ || bytes.size() > written_ - offset) {
    return Error{Exit::internal, "", "patched beyond its end", target_, ""};
  }
  return write_at(offset, bytes);
}

Result<void> OutputFile::commit() {
  if (Result<void> flushed = flush(); !flushed) return flushed;
  if (::close(std::exchange(descriptor_, -1)) != 0) return io_error(target_, "cannot be written");
  return file_.commit();
}

Result<void> OutputFile::flush() {
  if (Result<void> written = write_at(written_, buffer_); !written) return written;
  written_ += buffer_.size();
  buffer_.clear();
  return {};
}

Result<void> OutputFile::write_at(std::uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0) {
      if (errno == EINTR) continue;
      return io_error(target_, "cannot be written");
    }
    bytes.remove_prefix(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
  return {};
}

}  // namespace octrace::util
