// Median and spread of repeated measurements.
#pragma once

#include <algorithm>
#include <vector>

namespace octrace::bench {

struct Spread {
  double median = 0.0, lowest = 0.0, highest = 0.0;
};

inline Spread spread_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  if (values.empty()) return {};
  const std::size_t n = values.size();
  const double median = n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {median, values.front(), values.back()};
}

}  // namespace octrace::bench
