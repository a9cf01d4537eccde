#include "backend/batch/run_length.h"

namespace octrace::batch {

namespace {

constexpr int kBits = 5;
constexpr int kMore = 1 << kBits, kSign = 1 << (kBits - 1);
constexpr char kFirst = '0';

util::Error invalid(const char* message) {
  return {util::Exit::invalid_input, "INVALID_RLE", message, "", ""};
}

}  // namespace

std::string compress_counts(std::span<const std::uint64_t> counts) {
  std::string text;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    auto value = static_cast<std::int64_t>(counts[i]);
    if (i > 2) value -= static_cast<std::int64_t>(counts[i - 2]);
    for (bool more = true; more;) {
      int digit = static_cast<int>(value & (kMore - 1));
      value >>= kBits;  // arithmetic: the sign stays
      more = value != (digit & kSign ? -1 : 0);
      if (more) digit |= kMore;
      text += static_cast<char>(kFirst + digit);
    }
  }
  return text;
}

util::Result<std::vector<std::uint64_t>> expand_counts(std::string_view text,
                                                       std::uint64_t pixels) {
  std::vector<std::uint64_t> counts;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < text.size();) {
    std::int64_t value = 0;
    for (int shift = 0;; shift += kBits) {
      if (i == text.size() || shift > 50) return invalid("a number does not end");
      const int digit = text[i++] - kFirst;
      if (digit < 0 || digit >= 2 * kMore) return invalid("not a character of run lengths");
      value |= static_cast<std::int64_t>(digit & (kMore - 1)) << shift;
      if (digit & kMore) continue;
      if (digit & kSign) value |= -(std::int64_t{1} << (shift + kBits));
      break;
    }
    if (counts.size() > 2) value += static_cast<std::int64_t>(counts[counts.size() - 2]);
    if (value < 0 || static_cast<std::uint64_t>(value) > pixels - sum) {
      return invalid("a run leaves the image");
    }
    sum += static_cast<std::uint64_t>(value);
    counts.push_back(static_cast<std::uint64_t>(value));
  }
  if (sum != pixels) return invalid("the runs are shorter than the image");
  return counts;
}

}  // namespace octrace::batch
