// A folder for intermediate files that is gone when the work is done, whatever way it ends.
#pragma once

#include <string>

#include "backend/util/result.h"

namespace octrace::validation {

class Scratch {
 public:
  // In TMPDIR, else /tmp; only the user may read it.
  static util::Result<Scratch> create(const std::string& prefix);
  Scratch(Scratch&& other) noexcept;
  Scratch& operator=(Scratch&&) = delete;
  ~Scratch();

  const std::string& path() const { return path_; }
  std::string file(const std::string& name) const { return path_ + "/" + name; }

 private:
  explicit Scratch(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace octrace::validation
