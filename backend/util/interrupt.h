// Ctrl-C and the like while there is work to stop in good order. Outside of that the default action
// stands: the process ends at once, and there is nothing to clean up.
#pragma once

#include <atomic>

namespace octrace::util {

// Between construction and destruction SIGINT, SIGTERM and SIGHUP set a flag instead of ending the
// process; a second one ends it.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
};

const std::atomic<bool>& interrupt_flag();
int interrupt_signal();  // the signal's number; 0: none came
// The work has stopped: the flag is taken back, so that what came of it can be written. The
// signal's number stays, and another signal ends the process.
void acknowledge_interrupt();

}  // namespace octrace::util
