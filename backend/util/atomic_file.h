// Output that is whole or absent: write to a temporary name beside the target, flush, rename.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "backend/util/result.h"

namespace octrace::util {

// A temporary file in the target's folder. Unless commit() succeeds, the destructor removes it.
class AtomicFile {
 public:
  // Errors (exit 5) where the folder does not exist or cannot be written to.
  static Result<AtomicFile> create(const std::string& target);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  // Keeps the target's extension, because image writers choose their format by it.
  const std::string& temporary() const { return temporary_; }
  // fsync, rename, fsync of the folder; or as a GroupedCommit of the thread has it
  // (grouped_commit.h). Refused after an interrupt (interrupt.h).
  Result<void> commit();

 private:
  AtomicFile(std::string target, std::string temporary)
      : target_(std::move(target)), temporary_(std::move(temporary)) {}
  std::string target_, temporary_;
};

// The file name whose temporary file, left behind by a killed process, is called `name`; nothing
// where it is none. Names without folders.
std::optional<std::string> target_of_temporary(std::string_view name);

Result<void> write_file(const std::string& target, std::string_view content);

}  // namespace octrace::util
