// Masks as COCO's run lengths: the pixels by columns from the top left, as lengths of runs that are
// outside and inside in turn, the first outside (0 where the first pixel is inside).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "backend/util/result.h"

namespace octrace::batch {

// Lengths as the string of COCO's own programs (rleToString in maskApi.c): five bits a character
// from '0' on, the least first, the sixth where more follow; from the fourth length on the
// difference to the one before the last.
std::string compress_counts(std::span<const std::uint64_t> counts);

// The other way; exit 3 where the string is none, or the runs do not add up to `pixels`.
util::Result<std::vector<std::uint64_t>> expand_counts(std::string_view text, std::uint64_t pixels);

}  // namespace octrace::batch
