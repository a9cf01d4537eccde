#include "backend/image/file_proxy.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace octrace::image {

FileProxy::FileProxy(const std::string& path)
    : IOProxy(path, Write), descriptor_(::open(path.c_str(), O_RDWR | O_TRUNC | O_CLOEXEC)) {
  if (descriptor_ < 0) error_number_ = errno;
}

FileProxy::~FileProxy() { close(); }

void FileProxy::close() {
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
  const size_t done = pwrite(buffer, size, m_pos);
  m_pos += static_cast<int64_t>(done);
  return done;
}

size_t FileProxy::pread(void* buffer, size_t size, int64_t offset) {
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
  return descriptor_ >= 0 && ::fstat(descriptor_, &status) == 0
             ? static_cast<size_t>(status.st_size)
             : 0;
}

}  // namespace octrace::image
