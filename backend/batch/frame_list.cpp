#include "backend/batch/frame_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <unordered_set>

namespace octrace::batch {

namespace {

struct Range {
  std::int64_t first = 0, last = 0, step = 1;
};

std::string_view trimmed(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  return text;
}

std::optional<std::int64_t> number(std::string_view text) {
  std::int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  const bool digits = !text.empty() && text.front() != '-';
  if (!digits || error != std::errc() || stop != end || value > kLastFrame) return std::nullopt;
  return value;
}

std::optional<Range> parse_range(std::string_view text) {
  const std::size_t dash = text.find('-');
  const std::size_t colon = text.find(':');
  if (dash == std::string_view::npos) {
    const auto single = number(text);
    if (!single) return std::nullopt;
    return Range{*single, *single, 1};
  }
  if (colon != std::string_view::npos && colon < dash) return std::nullopt;
  const auto first = number(text.substr(0, dash));
  const auto last = number(text.substr(dash + 1, colon - dash - 1));
  const auto step = colon == std::string_view::npos ? std::optional<std::int64_t>(1)
                                                    : number(text.substr(colon + 1));
  if (!first || !last || !step || *step == 0 || *last < *first) return std::nullopt;
  return Range{*first, *last, *step};
}

}  // namespace

util::Result<std::vector<std::int64_t>> parse_frames(std::string_view text, std::uint64_t most) {
  std::vector<std::int64_t> frames;
  std::unordered_set<std::int64_t> seen;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const std::string_view part = trimmed(text.substr(begin, comma - begin));
    const std::optional<Range> range = parse_range(part);
    if (!range) {
      return util::Error{util::Exit::usage, "",
                         fmt::format("needs frames such as \"7\", \"1-120\" or \"1-100:5,200\" "
                                     "(from 0 to {}, no range backwards), got \"{}\"",
                                     kLastFrame, part),
                         "", ""};
    }
    const auto count = static_cast<std::uint64_t>((range->last - range->first) / range->step) + 1;
    if (count > most || frames.size() + count > most) {
      return util::Error{
          util::Exit::limit, "",
          fmt::format("\"{}\" makes more than the {} views that --max-views allows", part, most),
          "", ""};
    }
    for (std::int64_t frame = range->first; frame <= range->last; frame += range->step) {
      if (seen.insert(frame).second) frames.push_back(frame);
    }
    begin = comma + 1;
  }
  return frames;
}

}  // namespace octrace::batch
