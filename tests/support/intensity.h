// How much work a randomised test does, and from which seed: OCTRACE_TEST_INTENSITY scales counts
// (default 1), OCTRACE_TEST_SEED repeats a failure.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace octrace::tests {

inline std::uint64_t scaled(std::uint64_t count) {
  const char* text = std::getenv("OCTRACE_TEST_INTENSITY");
  const double factor = text == nullptr ? 1.0 : std::atof(text);
  return static_cast<std::uint64_t>(static_cast<double>(count) * (factor > 0.0 ? factor : 1.0));
}

inline std::uint64_t seed() {
  const char* text = std::getenv("OCTRACE_TEST_SEED");
  return text == nullptr ? 20120801u : std::strtoull(text, nullptr, 10);
}

}  // namespace octrace::tests
