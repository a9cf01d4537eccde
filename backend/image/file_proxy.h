// The file that OpenImageIO writes through. Some of its writers lose errors that only show when
// buffers are flushed (a full disk); here every write is checked, and the first error is kept.
#pragma once

#include <OpenImageIO/filesystem.h>

#include <string>

namespace octrace::image {

class FileProxy final : public OIIO::Filesystem::IOProxy {
 public:
  explicit FileProxy(const std::string& path);  // an existing file, which is emptied
  ~FileProxy() override;

  const char* proxytype() const override { return "octrace"; }
  void close() override;
  size_t read(void* buffer, size_t size) override;
  size_t write(const void* buffer, size_t size) override;
  size_t pread(void* buffer, size_t size, int64_t offset) override;
  size_t pwrite(const void* buffer, size_t size, int64_t offset) override;
  size_t size() const override;

  int error_number() const { return error_number_; }  // 0: no read or write failed

 private:
  int descriptor_ = -1;
  int error_number_ = 0;
};

}  // namespace octrace::image
