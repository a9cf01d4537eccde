// A tar archive (POSIX.1-2001, ustar with pax names where they are long), whole or absent, of the
// same bits whoever writes it and when: no times, no owners.
#pragma once

#include <string>
#include <string_view>

#include "backend/util/atomic_file.h"
#include "backend/util/result.h"

namespace octrace::batch {

class TarFile {
 public:
  static util::Result<TarFile> create(const std::string& target);
  TarFile(TarFile&& other) noexcept;
  TarFile& operator=(TarFile&&) = delete;
  ~TarFile();

  util::Result<void> add(const std::string& name, std::string_view content);
  util::Result<std::uint64_t> commit();  // bytes of the whole

 private:
  TarFile(util::AtomicFile file, int descriptor, std::string target)
      : file_(std::move(file)), descriptor_(descriptor), target_(std::move(target)) {}
  util::Result<void> add_entry(std::string_view name, char type, std::string_view content);
  util::Result<void> write(std::string_view bytes);

  util::AtomicFile file_;
  int descriptor_ = -1;
  std::string target_;
  std::uint64_t bytes_ = 0;
};

}  // namespace octrace::batch
