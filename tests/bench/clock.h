// What benchmarks on the CPU measure by.
#pragma once

#include <ctime>

namespace octrace::bench {

// Seconds since some moment. With one thread they are the process's own processor time, so that
// other programs on the machine cost neither peer anything but cache; with more, wall-clock time.
inline double seconds_now(unsigned threads) {
  timespec now{};
  clock_gettime(threads == 1 ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

// Wall-clock time alone, as builds are measured.
inline double wall_seconds() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

}  // namespace octrace::bench
