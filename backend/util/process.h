// What the operating system says about this process, and a clock for measuring it.
#pragma once

#include <chrono>
#include <cstdint>

namespace octrace::util {

std::uint64_t peak_resident_bytes();  // 0 where the system does not say

class Timer {
 public:
  double milliseconds() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  double seconds() const { return milliseconds() * 1e-3; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace octrace::util
