// How far a batch has come, told on standard error.
#pragma once

#include "backend/batch/runner.h"
#include "backend/util/process.h"

namespace octrace::app {

enum class BatchProgressMode { automatic, bar, json, openjd, none };

class BatchProgress {
 public:
  explicit BatchProgress(BatchProgressMode mode);  // automatic: a bar on a terminal, unless quiet
  void update(const batch::Standing& standing);    // at most ten are shown a second
  void finish(const batch::Standing& standing);

 private:
  void show(const batch::Standing& standing);
  BatchProgressMode mode_;
  util::Timer timer_;
  double shown_ms_ = -1e9;
  bool bar_visible_ = false;
};

}  // namespace octrace::app
