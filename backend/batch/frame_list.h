// The frames of a job: "12", "1-120", "1-100:5,200".
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::batch {

inline constexpr std::int64_t kLastFrame = 1'000'000'000;

// In the order given, each frame once. The error's message says what is wrong, without a place: a
// usage error, or exit 6 where there are more than `most`.
util::Result<std::vector<std::int64_t>> parse_frames(std::string_view text, std::uint64_t most);

}  // namespace octrace::batch
