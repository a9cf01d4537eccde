#include "backend/image/file_proxy.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace octrace::image {

namespace {
constexpr std::size_t kMostWaiting = std::size_t{256} << 10;
}

FileProxy::FileProxy(const std::string& path)
    : IOProxy(path, Write), descriptor_(::open(path.c_str(), O_RDWR | O_TRUNC | O_CLOEXEC)) {
  if (descriptor_ < 0) error_number_ = errno;
}

FileProxy::~FileProxy() { close(); }

void FileProxy::close() {
  write_waiting();
  if (descriptor_ >= 0 && ::close(descriptor_) != 0 && error_number_ == 0) error_number_ = errno;
  descriptor_ = -1;
  m_mode = Closed;
}

size_t FileProxy::read(void* buffer, size_t size) {
  const size_t done = pread(buffer, size, m_pos);
  m_pos += static_cast<int64_t>(done);
  return done;
}

size_t FileProxy::write(const void* buffer, size_t size) {
  if (m_pos != waiting_offset_ + static_cast<int64_t>(waiting_.size()) ||
      waiting_.size() + size > kMostWaiting) {
    write_waiting();
    waiting_offset_ = m_pos;
  }
  if (error_number_ != 0) return 0;
  size_t done = size;
  if (size > kMostWaiting) {
    done = write_at(buffer, size, m_pos);
    waiting_offset_ += static_cast<int64_t>(done);
  } else {
    const auto* bytes = static_cast<const char*>(buffer);
    waiting_.insert(waiting_.end(), bytes, bytes + size);
  }
  m_pos += static_cast<int64_t>(done);
  return done;
}

void FileProxy::write_waiting() {
  if (!waiting_.empty()) write_at(waiting_.data(), waiting_.size(), waiting_offset_);
  waiting_.clear();
}

size_t FileProxy::pread(void* buffer, size_t size, int64_t offset) {
  write_waiting();
  size_t done = 0;
  while (done < size) {
    const ssize_t got = ::pread(descriptor_, static_cast<char*>(buffer) + done, size - done,
                                offset + static_cast<int64_t>(done));
    if (got == 0) break;
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      if (error_number_ == 0) error_number_ = errno;
      break;
    }
    done += static_cast<size_t>(got);
  }
  return done;
}

size_t FileProxy::pwrite(const void* buffer, size_t size, int64_t offset) {
  write_waiting();
  return write_at(buffer, size, offset);
}

size_t FileProxy::write_at(const void* buffer, size_t size, int64_t offset) {
  size_t done = 0;
  while (done < size) {
    const ssize_t put = ::pwrite(descriptor_, static_cast<const char*>(buffer) + done, size - done,
                                 offset + static_cast<int64_t>(done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) {
      if (error_number_ == 0) error_number_ = put < 0 ? errno : EIO;
      break;
    }
    done += static_cast<size_t>(put);
  }
  return done;
}

size_t FileProxy::size() const {
  struct stat status {};
  if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) return 0;
  return std::max(static_cast<size_t>(status.st_size),
                  static_cast<size_t>(waiting_offset_) + waiting_.size());
}

}  // namespace octrace::image
