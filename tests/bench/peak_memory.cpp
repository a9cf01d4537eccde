#include "tests/bench/peak_memory.h"

#include <malloc.h>

#include <fstream>
#include <string>

namespace octrace::bench {

namespace {

// A line of /proc/self/status, such as VmHWM, in bytes.
std::uint64_t status(const std::string& name) {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;) {
    std::uint64_t kilobytes = 0;
    if (word == name + ":" && file >> kilobytes) return kilobytes * 1024;
  }
  return 0;
}

}  // namespace

PeakMemory::PeakMemory() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // proc(5): resets VmHWM
  start_ = status("VmRSS");
}

std::uint64_t PeakMemory::bytes() const {
  const std::uint64_t peak = status("VmHWM");
  return peak > start_ ? peak - start_ : 0;
}

}  // namespace octrace::bench
