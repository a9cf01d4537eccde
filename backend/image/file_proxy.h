// The file that OpenImageIO writes through. Some of its writers lose errors that only show when
// buffers are flushed (a full disk); here every write is checked, and the first error is kept. Some
// write a number at a time, 400 writes an EXR of 640x480: those that follow each other go together.
#pragma once

#include <OpenImageIO/filesystem.h>

#include <string>
#include <vector>

namespace octrace::image {

// For one thread.
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

  // 0: no read or write failed. All is known after close().
  int error_number() const { return error_number_; }

 private:
  void write_waiting();
  size_t write_at(const void* buffer, size_t size, int64_t offset);

  int descriptor_ = -1;
  int error_number_ = 0;
  std::vector<char> waiting_;   // written by the library and not to the file
  int64_t waiting_offset_ = 0;  // where they go
};

}  // namespace octrace::image
