// The most memory that the process holds at once from here on, by the kernel's own count.
#pragma once

#include <cstdint>

namespace octrace::bench {

class PeakMemory {
 public:
  PeakMemory();  // gives free memory back to the system and forgets the peak so far
  // Beyond what was held at the start; 0 where the kernel does not say.
  std::uint64_t bytes() const;

 private:
  std::uint64_t start_;
};

}  // namespace octrace::bench
