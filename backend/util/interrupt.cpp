#include "backend/util/interrupt.h"

#include <array>
#include <csignal>

namespace octrace::util {

namespace {

std::atomic<bool> flag{false};
std::atomic<int> signal_number{0};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};

void on_signal(int number) {
  signal_number = number;
  flag = true;
}

}  // namespace

InterruptGuard::InterruptGuard() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (const int number : kSignals) {
    struct sigaction old {};
    // nohup and background jobs ignore some signals on purpose.
    if (::sigaction(number, nullptr, &old) == 0 && old.sa_handler == SIG_IGN) continue;
    ::sigaction(number, &action, nullptr);
  }
}

InterruptGuard::~InterruptGuard() {
  for (const int number : kSignals) {
    struct sigaction old {};
    if (::sigaction(number, nullptr, &old) == 0 && old.sa_handler == on_signal) {
      std::signal(number, SIG_DFL);
    }
  }
}

const std::atomic<bool>& interrupt_flag() { return flag; }
int interrupt_signal() { return signal_number; }
void acknowledge_interrupt() { flag = false; }

}  // namespace octrace::util
