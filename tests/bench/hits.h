// Do two tracers see the same?
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/ray.h"

namespace octrace::bench {

// What tracers must share before their times are compared.
inline constexpr double kLeastAgreement = 0.9999;

// The share of rays whose hits agree: the same triangle, or the same t within 1e-5.
inline double agreement(const std::vector<kernels::Hit>& a, const std::vector<kernels::Hit>& b,
                        bool any_hit) {
  if (a.size() != b.size()) return 0.0;
  std::size_t agreeing = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool same_kind = a[i].valid() == b[i].valid();
    const bool same = any_hit || !a[i].valid() || a[i].triangle == b[i].triangle ||
                      std::abs(a[i].t - b[i].t) <= 1e-5f * std::abs(b[i].t);
    agreeing += same_kind && same;
  }
  return a.empty() ? 1.0 : static_cast<double>(agreeing) / static_cast<double>(a.size());
}

// Rays whose hits differ in any bit of the triangle, t, u or v; any_hit: in whether there is one.
inline std::uint64_t differing_hits(const std::vector<kernels::Hit>& a,
                                    const std::vector<kernels::Hit>& b, bool any_hit) {
  const auto bits = [](float f) { return std::bit_cast<std::uint32_t>(f); };
  std::uint64_t differing = a.size() > b.size() ? a.size() - b.size() : b.size() - a.size();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const bool same =
        any_hit
            ? a[i].valid() == b[i].valid()
            : a[i].triangle == b[i].triangle &&
                  (!a[i].valid() || (bits(a[i].t) == bits(b[i].t) && bits(a[i].u) == bits(b[i].u) &&
                                     bits(a[i].v) == bits(b[i].v)));
    differing += !same;
  }
  return differing;
}

}  // namespace octrace::bench
