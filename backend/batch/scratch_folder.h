// A folder of this process's own below $TMPDIR (/tmp without it), removed at the end with what is
// in it.
#pragma once

#include <string>

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
  explicit ScratchFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

// The file's content; the file is gone afterwards.
util::Result<std::string> take_file(const std::string& path);

}  // namespace octrace::batch
