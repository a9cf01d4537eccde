// A folder of this process's own below $TMPDIR (/tmp without it), removed at the end with what is
// in it. Each holds a locked file, so that what killed runs left there is told apart and removed
// when the next folder is made.
#pragma once

#include <string>
#include <utility>

#include "backend/util/result.h"

namespace octrace::batch {

class ScratchFolder {
 public:
  static util::Result<ScratchFolder> create();  // exit 5
  ScratchFolder(ScratchFolder&& other) noexcept;
  ScratchFolder& operator=(ScratchFolder&&) = delete;
  ~ScratchFolder();

  const std::string& path() const { return path_; }  // ends in '/'

 private:
  ScratchFolder(std::string path, int lock) : path_(std::move(path)), lock_(lock) {}
  std::string path_;
  int lock_;
};

// The file's content; the file is gone afterwards.
util::Result<std::string> take_file(const std::string& path);

}  // namespace octrace::batch
