#include "backend/app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "backend/util/log.h"

namespace octrace::app {

namespace {

constexpr double kIntervalMs = 100.0;
constexpr std::size_t kBarWidth = 32;

ProgressMode resolve(ProgressMode mode) {
  if (mode != ProgressMode::automatic) return mode;
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  return terminal && util::verbosity() != util::Verbosity::quiet ? ProgressMode::bar
                                                                 : ProgressMode::none;
}

void print(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace

Progress::Progress(ProgressMode mode) : mode_(resolve(mode)) {}

void Progress::stage(const char* name) {
  finish();
  stage_ = name;
  stage_timer_ = util::Timer();
  shown_ms_ = 0.0;
  show(0.0);
}

void Progress::update(double share) {
  const double now = stage_timer_.milliseconds();
  if (now - shown_ms_ < kIntervalMs) return;
  shown_ms_ = now;
  show(std::clamp(share, 0.0, 1.0));
}

void Progress::finish() {
  if (stage_.empty()) return;
  if (mode_ == ProgressMode::json) show(1.0);
  if (bar_visible_) print("\r\033[K");  // results follow where the bar was
  bar_visible_ = false;
  stage_.clear();
}

void Progress::show(double share) {
  const double elapsed = stage_timer_.seconds();
  const double left = share > 0.0 ? elapsed * (1.0 - share) / share : 0.0;
  if (mode_ == ProgressMode::json) {
    const std::string eta = share > 0.0 ? fmt::format(",\"eta_s\":{:.3f}", left) : "";
    print(fmt::format("{{\"stage\":\"{}\",\"done\":{:.4f},\"elapsed_s\":{:.3f}{}}}\n", stage_,
                      share, elapsed, eta));
  } else if (mode_ == ProgressMode::bar) {
    const auto filled = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
    const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
    const std::string eta = share > 0.0 ? fmt::format(", {:.0f} s left", left) : "";
    print(fmt::format("\r\033[K{:<5} [{}] {:3.0f} %{}", stage_, bar, share * 100.0, eta));
    bar_visible_ = true;
  }
}

}  // namespace octrace::app
