#include "backend/app/batch_progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "backend/util/log.h"

namespace octrace::app {

namespace {

constexpr double kIntervalMs = 100.0;
constexpr std::size_t kBarWidth = 32;

BatchProgressMode resolve(BatchProgressMode mode) {
  if (mode != BatchProgressMode::automatic) return mode;
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  return terminal && util::verbosity() != util::Verbosity::quiet ? BatchProgressMode::bar
                                                                 : BatchProgressMode::none;
}

void print(std::FILE* stream, const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stream);
  std::fflush(stream);
}

// "12 s", "3 min", "2.5 h"
std::string duration(double seconds) {
  if (seconds < 100.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 6000.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

}  // namespace

BatchProgress::BatchProgress(BatchProgressMode mode) : mode_(resolve(mode)) {}

void BatchProgress::update(const batch::Standing& standing) {
  const double now = timer_.milliseconds();
  if (now - shown_ms_ < kIntervalMs) return;
  shown_ms_ = now;
  show(standing);
}

void BatchProgress::finish(const batch::Standing& standing) {
  if (mode_ == BatchProgressMode::json || mode_ == BatchProgressMode::openjd) show(standing);
  if (bar_visible_) print(stderr, "\r\033[K");  // results follow where the bar was
  bar_visible_ = false;
}

void BatchProgress::show(const batch::Standing& standing) {
  const std::uint64_t over = standing.before + standing.done + standing.failed;
  const double share =
      standing.views > 0 ? static_cast<double>(over) / static_cast<double>(standing.views) : 1.0;
  const double rate = standing.views_per_s();
  const double left = rate > 0.0 ? static_cast<double>(standing.left()) / rate : 0.0;
  switch (mode_) {
    case BatchProgressMode::json: {
      nlohmann::ordered_json json = {
          {"views", standing.views},       {"done", standing.before + standing.done},
          {"failed", standing.failed},     {"share", share},
          {"elapsed_s", standing.seconds}, {"views_per_s", rate}};
      if (rate > 0.0) json["eta_s"] = left;
      json["scene"] = standing.scene;
      print(stderr,
            json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
      break;
    }
    case BatchProgressMode::openjd:
      // Open Job Description takes these from a task's standard output.
      print(stdout,
            fmt::format("openjd_progress: {:.2f}\nopenjd_status: {} of {} views{}\n", share * 100.0,
                        over, standing.views,
                        standing.failed > 0 ? fmt::format(", {} failed", standing.failed) : ""));
      break;
    case BatchProgressMode::bar: {
      const auto filled = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
      const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
      print(stderr,
            fmt::format("\r\033[K[{}] {}/{} views, {:.1f} views/s{}{}", bar, over, standing.views,
                        rate, rate > 0.0 ? ", " + duration(left) + " left" : "",
                        standing.failed > 0 ? fmt::format(", {} failed", standing.failed) : ""));
      bar_visible_ = true;
      break;
    }
    default:
      break;
  }
}

}  // namespace octrace::app
