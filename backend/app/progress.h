// How far a render has come, told on standard error.
#pragma once

#include <chrono>
#include <string>

#include "backend/util/process.h"

namespace octrace::app {

enum class ProgressMode { automatic, bar, json, none };

class Progress {
 public:
  explicit Progress(
      ProgressMode mode);        // automatic: a bar on a terminal, unless quiet; else nothing
  void stage(const char* name);  // "load", "trace", "write"; ends the one before
  void update(double share);     // of the current stage, 0 to 1; at most ten are shown a second
  void finish();

 private:
  void show(double share);
  ProgressMode mode_;
  std::string stage_;
  util::Timer stage_timer_;
  double shown_ms_ = 0.0;
  bool bar_visible_ = false;
};

}  // namespace octrace::app
