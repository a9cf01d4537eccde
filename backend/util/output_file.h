// A file written from front to back through a buffer, for output too large to hold in memory. It
// appears under its name when committed; what was begun and not committed leaves nothing.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "backend/util/atomic_file.h"

namespace octrace::util {

// Every error is exit 5 and names the target.
class OutputFile {
 public:
  static Result<OutputFile> create(const std::string& target);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  Result<void> append(std::string_view bytes);
  // Overwrites bytes that were appended before: a length that is known only afterwards.
  Result<void> patch(std::uint64_t offset, std::string_view bytes);
  std::uint64_t size() const { return written_ + buffer_.size(); }
  Result<void> flush();  // the buffer into the temporary file, where others may read it
  const std::string& temporary() const { return file_.temporary(); }
  Result<void> commit();

 private:
  OutputFile(AtomicFile file, std::string target, int descriptor)
      : file_(std::move(file)), target_(std::move(target)), descriptor_(descriptor) {}
  Result<void> write_at(std::uint64_t offset, std::string_view bytes);

  AtomicFile file_;
  std::string target_, buffer_;
  int descriptor_ = -1;
  std::uint64_t written_ = 0;  // without what the buffer holds
};

}  // namespace octrace::util
